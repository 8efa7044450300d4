"""Findings of the data doctor, as text and JSON values, and in the summary of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, data_hash, history, with_summary, with_warnings
from robotrue.core.json_values import json_values
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.validation.doctor import Diagnosis, NamedCause
from robotrue.validation.doctor_suspicion import CauseName

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
    """Returns the model whose summary and lineage say which rows were put right, and how."""
    document = _finding_document(finding, raw)
    step = {
        "step": "cure",
        "rows": len(raw),
        "data_sha256": data_hash(raw),
        "sources": list(raw.sources),
        "settings": document,
    }
    told = (
        f"{name_lines(finding, raw)} corrected before the fit (--cure "
        f"{finding.hypothesis.cause}): {finding.hypothesis.text}."
    )
    more = {"verdict": "conditional", "cure": document, "lineage": [step, *history(model)]}
    return with_warnings(with_summary(model, more), [told])
