"""The data doctor: identifies faults of measured rows, and offers to correct them.

Every suspicion proposes its likeliest hypothesis by cheap tests; the best few are fitted again and
compared with "clean" by their Bayes factor. Corrections are applied on request only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import expit

from robotrue.calibration.model import ErrorModel, data_hash, history, with_summary, with_warnings
from robotrue.calibration.parameters import IMPLAUSIBLE
from robotrue.calibration.settings import FitSettings
from robotrue.core.json_values import json_values
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.doctor_case import open_case
from robotrue.validation.doctor_evidence import (
    HOPELESS,
    CauseName,
    DataSuspicion,
    Evidence,
    Hypothesis,
    fit_rows,
    learn,
    weigh_noise,
)
from robotrue.validation.doctor_groups import SCATTERED, Clock, JointsEarly, find_repeats
from robotrue.validation.doctor_readings import JointOffset, Misread, find_turns
from robotrue.validation.doctor_segments import SEGMENTS, Drift

SUSPICIONS: Final[tuple[DataSuspicion, ...]] = (
    *SEGMENTS, Drift(), *SCATTERED, JointsEarly(), Clock(), Misread(), JointOffset(),
)  # fmt: skip
CERTAIN: Final = (find_repeats, find_turns)
FEWEST_ROWS: Final = 15
"""Rows below which nothing is suspected but repeats."""
PRIOR: Final = 0.05
"""Belief that a file has one of the causes, before it is looked at."""
SURE: Final = 0.995
"""Probability of a cause from which it is named, and of one of two parts to be the wrong one."""
REFITTED: Final = 4
REFINEMENTS: Final = 3
"""Steps by which the effect of a cause that is not linear is estimated again."""
WORTHWHILE: Final = 1.0
"""Gain of log evidence below which no further step is made."""
LARGEST_ODDS: Final = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedCause:
    """A cause that is named.

    Attributes:
        hypothesis: The fault, its rows, and the corrected rows.
        probability: Of the cause, against clean rows and all other causes.
        before: m, mean error of each row predicted from the others, for the unchanged file.
        after: m, the same once it is corrected; NaN where that is outside the rows.
    """

    hypothesis: Hypothesis
    probability: float
    before: float
    after: float

    @property
    def odds(self) -> float:
        """Probability over one minus it, at most :data:`LARGEST_ODDS`."""
        return min(self.probability / max(1.0 - self.probability, 1e-9), LARGEST_ODDS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Findings of the data doctor on a measurement set.

    Attributes:
        findings: Named causes, those that need no statistics first.
        considered: Cause and log Bayes factor of every hypothesis that was compared.
        error: m, mean error of each row predicted from the others, for the unchanged file.
        examined: Rows that were looked at.
        rows: Rows of the set.
    """

    findings: tuple[NamedCause, ...]
    considered: tuple[tuple[str, float], ...]
    error: float
    examined: int
    rows: int


def diagnose(
    robot: RobotModel, rows: MeasurementSet, settings: FitSettings | None = None
) -> Diagnosis:
    """Returns the detected faults of measured rows; changes nothing.

    Args:
        robot: Nominal arm with the measured reflector.
        rows: In base or in a tracker frame; they need not be plausible.
        settings: Loads, priors, repeatability.
    """
    used = FitSettings() if settings is None else settings
    found: list[NamedCause] = []
    standing = rows
    if len(rows) < FEWEST_ROWS:
        return Diagnosis(findings=(), considered=(), error=np.nan, examined=0, rows=len(rows))
    clean = _fit_clean(robot, standing, used)
    for find_certain in CERTAIN:
        for hypothesis in find_certain(standing, robot):
            found.append(_weigh_certain(hypothesis, robot, used, clean))
            standing = standing if hypothesis.cured is None else hypothesis.cured
    if found:
        clean = _fit_clean(robot, standing, used)
    compared = _compare(clean)
    error = _mean_error(clean)
    named = _name_best(compared)
    if named is not None:
        best, probability = named
        best, corrected = _decide_part(best, clean)
        if corrected is None or not _implausible(corrected):
            after = float("nan") if corrected is None else _mean_error(corrected)
            found.append(
                NamedCause(hypothesis=best, probability=probability, before=error, after=after)
            )
    return Diagnosis(
        findings=tuple(found),
        considered=tuple((each.cause, each.log_odds) for each in compared),
        error=error,
        examined=len(clean.case.chosen),
        rows=len(rows),
    )


def _fit_clean(robot: RobotModel, rows: MeasurementSet, settings: FitSettings) -> Evidence:
    return fit_rows(open_case(robot, rows, settings))


def _compare(clean: Evidence) -> list[Hypothesis]:
    """Returns every suspicion's hypotheses, the best of them fitted again, the likeliest first."""
    tried = [hypothesis for suspicion in SUSPICIONS for hypothesis in suspicion.look(clean)]
    tried.sort(key=lambda each: -each.log_odds)
    refitted = [
        _refit(each, clean)
        if each.columns is not None and k < REFITTED and each.log_odds > HOPELESS
        else each
        for k, each in enumerate(tried)
    ]
    return sorted(refitted, key=lambda each: -each.log_odds)


def _refit(hypothesis: Hypothesis, clean: Evidence) -> Hypothesis:
    evidence = learn(clean.case, hypothesis.columns, clean.scales)
    stated = max(clean.log_evidence, weigh_noise(clean.case, evidence.scales))
    odds = evidence.log_evidence - stated - hypothesis.price
    # The effect of the wrong rows was noise before.
    revise = hypothesis.revise
    revised = hypothesis if revise is None else revise(evidence.coefficients())
    return replace(revised, log_odds=odds, rival=hypothesis.rival)


def _name_best(compared: Sequence[Hypothesis]) -> tuple[Hypothesis, float] | None:
    if not compared:
        return None
    share = np.log(PRIOR / len(SUSPICIONS))
    weights = np.array([np.log(1.0 - PRIOR), *(each.log_odds + share for each in compared)])
    weights = np.exp(weights - weights.max())
    clean = float(weights[0] / weights.sum())
    best = compared[0]
    # The question is whether the rows are clean; between causes of one effect the best is named.
    return (best, 1.0 - clean) if 1.0 - clean > SURE else None


def _weigh_certain(
    hypothesis: Hypothesis, robot: RobotModel, settings: FitSettings, clean: Evidence
) -> NamedCause:
    return NamedCause(
        hypothesis=hypothesis,
        probability=1.0,
        before=_mean_error(clean),
        after=_error_after(hypothesis, robot, settings),
    )


def _mean_error(evidence: Evidence) -> float:
    return float(np.linalg.norm(evidence.predict_left_out()[0], axis=1).mean())


def _error_after(hypothesis: Hypothesis, robot: RobotModel, settings: FitSettings) -> float:
    cured = hypothesis.cured
    if cured is None:
        return float("nan")
    return _mean_error(_fit_clean(robot, cured, settings))


def _decide_part(best: Hypothesis, clean: Evidence) -> tuple[Hypothesis, Evidence | None]:
    """The hypothesis, or its rival if that is likelier, and the fit of the corrected rows.

    Where the rows do not show which of both is true it has no cure: half of the cures would make
    the right rows wrong. Compared are the rows as read: a correction that shrinks lengths would
    make any rows denser.
    """
    if best.rival is None:
        return _refine_cure(best, clean)
    trials = [_refine_cure(each, clean) for each in (best, _refit(best.rival(), clean))]
    odds = [_weigh_correction(clean.case.rows, *trial) for trial in trials]
    first = int(np.argmax(odds))
    if odds[first] == -np.inf or expit(odds[first] - odds[1 - first]) > SURE:
        return trials[first]
    likelier, other = trials[first][0], trials[1 - first][0]
    return replace(
        likelier,
        text=f"{likelier.text}, or in all other rows {other.text}: the rows do not show which",
        cure=None,
        advice=f"{likelier.advice} and of all others, and correct the wrong ones in the file",
    ), None


def _weigh_correction(
    raw: MeasurementSet, hypothesis: Hypothesis, fitted: Evidence | None
) -> float:
    """Log density of the examined rows as read; -inf if they stay implausible once corrected."""
    if fitted is None or hypothesis.cured is None or _implausible(fitted):
        return -np.inf
    rows = np.intersect1d(hypothesis.rows, fitted.case.chosen)
    corrected, read = hypothesis.cured.position[rows], raw.position[rows]
    factor = np.linalg.norm(corrected) / np.linalg.norm(read)
    return float(fitted.log_evidence + read.size * np.log(factor))


def _implausible(fitted: Evidence) -> bool:
    return _mean_error(fitted) > IMPLAUSIBLE * fitted.case.robot.reach


def _refine_cure(hypothesis: Hypothesis, clean: Evidence) -> tuple[Hypothesis, Evidence | None]:
    """The hypothesis with its rows corrected by further steps, and the fit of them."""
    if hypothesis.cured is None:
        return hypothesis, None
    robot, settings = clean.case.robot, clean.case.settings
    best = _fit_clean(robot, hypothesis.cured, settings)
    for _ in range(REFINEMENTS):
        refined = None if hypothesis.refine is None else hypothesis.refine(best)
        if refined is None or refined.cured is None:
            break
        trial = _fit_clean(robot, refined.cured, settings)
        gain = trial.log_evidence - best.log_evidence
        if gain > 0.0:
            best = trial
            hypothesis = replace(
                hypothesis, text=refined.text, cure=refined.cure, refine=refined.refine
            )
        if gain < WORTHWHILE:
            break
    return hypothesis, best


def cure_rows(
    robot: RobotModel, rows: MeasurementSet, settings: FitSettings | None, cause: str
) -> tuple[MeasurementSet, NamedCause]:
    """Returns the corrected rows for one named cause, and the finding; the given rows stay.

    Args:
        robot: Nominal arm with the measured reflector.
        rows: As read.
        settings: Loads, priors, repeatability.
        cause: Name of the cause.

    Raises:
        ConfigurationError: The doctor does not find that cause, or its cure is outside the rows.
    """
    diagnosis = diagnose(robot, rows, settings)
    names = [each.hypothesis.cause for each in diagnosis.findings]
    for finding in diagnosis.findings:
        if finding.hypothesis.cause != cause:
            continue
        if finding.hypothesis.cured is None:
            raise ConfigurationError(
                f"{cause}: it cannot correct rows.", hint=f"{finding.hypothesis.advice}."
            )
        return finding.hypothesis.cured, finding
    listed = ", ".join(names) or "nothing"
    raise ConfigurationError(
        f"cure {cause!r} does not fit these rows: the data doctor finds {listed}.",
        hint="robotrue inspect MEAS --doctor CELL lists its findings.",
    )


SIX_WORDS: Final[Mapping[CauseName, str]] = {
    "instrument-moved": "Tracker moved while poses were measured",
    "drift": "Tracker drifted from first to last",
    "reflector": "Reflector changed place on the flange",
    "scale": "Positions have another scale or unit",
    "payload": "Payload changed during the measurement run",
    "one-direction": "Single points jumped the same way",
    "joints-early": "Joints were read before arm settled",
    "clock": "Joint and point clocks are apart",
    "shifted-rows": "Joints belong to the neighbouring row",
    "joint-sign": "One joint has the wrong sign",
    "joint-turn": "One joint is a turn off",
    "joint-offset": "One joint's zero is far off",
    "joints-exchanged": "Two joint columns have been exchanged",
    "preset": "The cell states the wrong robot",
    "duplicates": "Some rows are in file twice",
    "stale-points": "Tracker point was not read again",
}
"""The warning that a shop's engineer reads first: six words a cause."""
SHOWN: Final = 6
"""Ranges of lines that are written out."""


def describe_finding(finding: NamedCause, rows: MeasurementSet) -> str:
    """Returns one sentence: six words, what and where, odds, gain, cure.

    Args:
        finding: Of :func:`robotrue.validation.doctor.diagnose`.
        rows: The set it was found in.
    """
    found = finding.hypothesis
    gain = f"a row is predicted from the others to {finding.before / MM:.3f} mm"
    if np.isfinite(finding.after):
        gain += f", cured {finding.after / MM:.3f} mm"
    cure = f"--cure {found.cause}, or " if found.cured is not None else ""
    return (
        f"data doctor: {SIX_WORDS[found.cause]}: {found.text}; {name_lines(finding, rows)}; "
        f"odds {finding.odds:.0f} to 1; {gain}; cure: {cure}{found.advice}."
    )


def name_lines(finding: NamedCause, rows: MeasurementSet) -> str:
    """Returns the lines of the file that are concerned, in ranges."""
    concerned = np.unique(finding.hypothesis.rows)
    if len(concerned) == len(rows):
        return f"all {len(rows)} rows"
    lines = rows.source_row[concerned]
    breaks = np.flatnonzero(np.diff(concerned) > 1) + 1
    parts = [
        f"{part[0]}" if len(part) == 1 else f"{part[0]} to {part[-1]}"
        for part in np.split(lines, breaks)
    ]
    shown = ", ".join(parts[:SHOWN]) + (", ..." if len(parts) > SHOWN else "")
    return f"lines {shown} ({len(concerned)} rows)" if len(concerned) > 1 else f"line {shown}"


def describe_diagnosis(diagnosis: Diagnosis, rows: MeasurementSet) -> list[str]:
    """Returns a sentence for every finding."""
    return [describe_finding(each, rows) for each in diagnosis.findings]


def diagnosis_document(diagnosis: Diagnosis, rows: MeasurementSet) -> dict[str, object]:
    """Returns JSON values: causes with odds, lines, gain in mm and cure."""
    return json_values(
        {
            "rows": diagnosis.rows,
            "examined": diagnosis.examined,
            "error_mm": diagnosis.error / MM,
            "findings": [_finding_document(each, rows) for each in diagnosis.findings],
            "considered": [
                {"cause": cause, "log_odds": float(odds)} for cause, odds in diagnosis.considered
            ],
        }
    )


def _finding_document(finding: NamedCause, rows: MeasurementSet) -> dict[str, object]:
    found = finding.hypothesis
    return json_values(
        {
            "cause": found.cause,
            "summary": SIX_WORDS[found.cause],
            "text": found.text,
            "odds": finding.odds,
            "lines": rows.source_row[np.unique(found.rows)],
            "before_mm": finding.before / MM,
            "after_mm": finding.after / MM,
            "cure": found.cause if found.cured is not None else None,
            "advice": found.advice,
        }
    )


def with_findings(model: ErrorModel, lines: list[str]) -> ErrorModel:
    """Returns the model with what the doctor found among its warnings; then it is conditional."""
    if not lines:
        return model
    return with_warnings(with_summary(model, {"verdict": "conditional"}), lines)


def with_cure(model: ErrorModel, finding: NamedCause, raw: MeasurementSet) -> ErrorModel:
    """Returns the model whose summary and lineage state the corrected rows and their correction."""
    document = _finding_document(finding, raw)
    step = {
        "step": "cure",
        "rows": len(raw),
        "data_sha256": data_hash(raw),
        "sources": list(raw.sources),
        "settings": document,
    }
    warning = (
        f"{name_lines(finding, raw)} corrected before the fit (--cure "
        f"{finding.hypothesis.cause}): {finding.hypothesis.text}."
    )
    more = {"verdict": "conditional", "cure": document, "lineage": [step, *history(model)]}
    return with_warnings(with_summary(model, more), [warning])
