"""The guard against negative transfer: sources count only as far as target poses agree.

Candidates compete on target poses held out in turn; sources are in every training part. The first
candidate, the transfer, is used unless another beats it by more than the noise; those that use the
target poses alone come last. So the choice is, on held-out target poses, never worse than the
target poses alone by more than the noise of that comparison.

The choice is one of name. With few target poses the model is the average, by held-out density, of
the candidates that the chosen one does not beat by more than the noise: ten poses decide no more.

Without target poses nothing can be checked; the model then states this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import ErrorModel, with_summary
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.document_decoder import decode
from robotrue.core.json_values import json_values
from robotrue.core.progress import Progress
from robotrue.core.units import MM
from robotrue.errors import ObservabilityError, RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.contest import (
    UNKNOWN,
    CandidateResults,
    Selection,
    StoppedCandidate,
    Trials,
    average_candidates,
    decide,
    drop_excluded,
    find_voters,
    selection_from_summary,
)
from robotrue.validation.metrics import wilson_interval
from robotrue.validation.selection import AVERAGED_ROWS, hold_out
from robotrue.validation.splits import random_folds

Candidate: TypeAlias = Callable[[MeasurementSet | None], ErrorModel]
"""Fits a model from the target rows it is given (None without any) and from what it holds."""

FEWEST_ROWS: Final = 3
"""Target rows from which they can be held out in turn."""
MOST_FOLDS: Final = 10
"""Up to so many target rows each is held out by itself."""
NEAR: Final = 0.05
"""Part of the reach within which target points are one place (rms distance from their middle)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardVerdict:
    """Verdict of the guard.

    Attributes:
        winner: The candidate used.
        checked: Whether target poses were held out.
        target_rows: How many there are.
        against: The best candidate of the target poses alone; empty if none could be fitted.
        gain: m, its mean held-out error minus the winner's; NaN if there is nothing to compare.
        noise: m, one-sided 95 % half width of that gain: the answer's error bar.
        doubts: What the user must know, one sentence each.
    """

    winner: str
    checked: bool
    target_rows: int
    against: str = ""
    gain: float = UNKNOWN
    noise: float = UNKNOWN
    doubts: tuple[str, ...]

    def summary(self) -> Mapping[str, object]:
        """Returns JSON values; lengths in m."""
        units = {"gain": "gain_m", "noise": "noise_m"}
        values = {**asdict(self), "against": self.against or None}
        return {units.get(name, name): json_values(value) for name, value in values.items()}


def select_guarded(
    transfers: Mapping[str, Candidate],
    alone: Mapping[str, Candidate],
    target: MeasurementSet | None,
    *,
    payload: Load | None = None,
    reach: float = np.inf,
    doubts: Sequence[str] = (),
    progress: Progress | None = None,
    requested: str = "",
) -> ErrorModel:
    """Returns the model of the candidate that wins on target poses, with the evidence.

    Its training summary gains ``"selection"`` (the contest, if there was one), ``"guard"``
    (:meth:`GuardVerdict.summary`) and the guard's sentences at the head of ``"doubts"``.

    Args:
        transfers: Candidates that use sources, the preferred one first.
        alone: Candidates that use the target rows alone, simplest first.
        target: Rows of the requested region, in one frame; None or no rows: nothing is checked.
        payload: Used where a row does not state its own.
        reach: m, of the arm; target points within a twentieth of it count as one place.
        doubts: Known before, e.g. of sources left out.
        progress: Called before every fit.
        requested: A candidate that is used regardless of the winner, which the verdict names.

    Raises:
        ObservabilityError: No candidate could be fitted.
    """
    rows = 0 if target is None else len(target)
    candidates = {**transfers, **alone}
    if target is None or rows < FEWEST_ROWS:
        return _fit_unchecked(candidates, target, tuple(doubts))
    folds = random_folds(rows, folds=min(rows, MOST_FOLDS))
    trials = hold_out(candidates, target, splits=folds, payload=payload, progress=progress)
    trials = replace(trials, rule=_rule(rows, len(folds)))
    selection = decide(trials)
    if requested and requested != selection.winner:
        doubts = (_tell_preference(selection.winner, requested, trials), *doubts)
        selection = _use_requested(selection, requested)
        transfers = {requested: transfers[requested], **transfers}
    verdict = _verdict(selection, trials, tuple(transfers), tuple(alone), target, reach, doubts)
    model = candidates[selection.winner](target)
    if not requested and rows < AVERAGED_ROWS and isinstance(model, CalibratedModel):
        names = drop_excluded(trials, selection, find_voters(trials, selection))
        others = {n: partial(candidates[n], target) for n in names if n != selection.winner}
        model, selection = average_candidates(model, others, trials, selection)
    return _with_verdict(model, verdict, {"selection": selection.summary()})


def _tell_preference(winner: str, requested: str, trials: Trials) -> str:
    """The sentence that another candidate holds better than the one requested."""
    scored = trials.scored
    if requested not in scored:
        return f"{requested} was requested and could not be checked; {winner} wins the contest."
    gain, noise = trials.gain(requested, winner)
    return (
        f"{requested} is used because it was requested; {winner} wins the contest, "
        f"{scored[winner].error.mean() / MM:.3f} mm against "
        f"{scored[requested].error.mean() / MM:.3f} mm on held-out target poses (gain "
        f"{gain / MM:.3f} mm, noise {noise / MM:.3f} mm)."
    )


def _use_requested(selection: Selection, requested: str) -> Selection:
    """The selection with the requested candidate in the place of the winner."""
    winner = selection.winner
    reason = selection.reason.replace(
        f"{winner} is used: ", f"{requested} is used as requested, {winner} wins: ", 1
    )
    return replace(selection, winner=requested, reason=reason)


def verdict_from_summary(summary: TrainingSummary) -> tuple[GuardVerdict, Selection | None] | None:
    """Returns what the guard wrote into a training summary, None if there was no guard."""
    stated = summary.guard
    if stated is None:
        return None
    names = {"gain_m": "gain", "noise_m": "noise"}
    known = {names.get(k, k): v for k, v in stated.items() if v is not None}
    verdict = decode(GuardVerdict, known, key="summary.guard")
    contest = summary.selection if verdict.checked else None
    return verdict, None if contest is None else selection_from_summary(contest)


def _fit_unchecked(
    candidates: Mapping[str, Candidate], target: MeasurementSet | None, doubts: tuple[str, ...]
) -> ErrorModel:
    """The first candidate that can be fitted, and the sentence that nothing was checked."""
    rows = 0 if target is None else len(target)
    failures = []
    for name, fit in candidates.items():
        try:
            model = fit(target if rows else None)
        except RobotrueError as cause:
            failures.append(f"{name}: {cause.message}")
            continue
        verdict = GuardVerdict(
            winner=name,
            checked=False,
            target_rows=rows,
            doubts=(_nothing_checked(name, rows), *doubts),
        )
        return _with_verdict(model, verdict, {})
    raise ObservabilityError(
        f"no candidate could be fitted; {'; '.join(failures) or 'there is none'}",
        hint="measure target poses, or give a source that can be used.",
    )


def _nothing_checked(name: str, rows: int) -> str:
    measured = "no target pose was measured" if not rows else f"only {rows} target poses"
    return (
        f"{measured}: {name} is used and was not checked against the target; measure "
        f"{FEWEST_ROWS} or more poses there to check it."
    )


def _rule(rows: int, folds: int) -> str:
    part = "each held out separately" if folds == rows else f"held out in {folds} random parts"
    return (
        f"{rows} target poses, {part}, sources always in training; the first candidate is used "
        "unless another wins by more than the one-sided 95 % interval over the parts, the target "
        "poses alone last"
    )


def _with_verdict(
    model: ErrorModel, verdict: GuardVerdict, evidence: Mapping[str, object]
) -> ErrorModel:
    doubts = [*verdict.doubts, *model.training_summary().warnings]
    return with_summary(model, {**evidence, "guard": dict(verdict.summary()), "doubts": doubts})


def _verdict(
    selection: Selection,
    trials: Trials,
    transfers: tuple[str, ...],
    alone: tuple[str, ...],
    target: MeasurementSet,
    reach: float,
    doubts: Sequence[str],
) -> GuardVerdict:
    scored = trials.scored
    rivals = [name for name in alone if name in scored]
    against = min(rivals, key=lambda name: float(scored[name].error.mean()), default="")
    gain = noise = UNKNOWN
    if against and against != selection.winner:
        gain, noise = trials.gain(against, selection.winner)
    found = [*_harm(selection, trials, transfers), *doubts]
    if transfers and not against:
        found.append(
            "the target poses alone could not be fitted: the benefit of the sources was not "
            "checked."
        )
    found += _width(scored[selection.winner], len(target)) + _one_place(target, reach)
    return GuardVerdict(
        winner=selection.winner,
        checked=True,
        target_rows=len(target),
        against=against,
        gain=gain,
        noise=noise,
        doubts=tuple(found),
    )


def _harm(selection: Selection, trials: Trials, transfers: tuple[str, ...]) -> list[str]:
    """Reports what happened to the first preferred transfer, if it was not used."""
    if selection.winner in transfers[:1] or not transfers:
        return []
    first, winner = transfers[0], selection.winner
    result = trials.held[first]
    if isinstance(result, RobotrueError):
        return [f"{first} could not be fitted, {winner} is used: {result.message}"]
    if isinstance(result, StoppedCandidate):
        return [f"{result.reason}."]
    gain, noise = trials.gain(first, winner)
    numbers = (
        f"{result.error.mean() / MM:.3f} mm against "
        f"{trials.scored[winner].error.mean() / MM:.3f} mm on held-out "
        f"target poses (gain {gain / MM:.3f} mm, noise {noise / MM:.3f} mm)"
    )
    if winner in transfers:
        return [f"{winner} is used and not {first}: {numbers}."]
    return [
        f"the sources increase the error: {first} has {numbers} for {winner}; the sources are not "
        "used."
    ]


def _width(winner: CandidateResults, rows: int) -> list[str]:
    low, high = wilson_interval(round(winner.inside * rows), rows)
    if high >= 0.95:
        return []
    return [
        f"the stated 95 % regions hold {100 * winner.inside:.0f} % of the held-out target poses "
        f"(interval {100 * low:.0f} to {100 * high:.0f} %): the stated uncertainty is too small, "
        "a prior is too tight or something is not modelled."
    ]


def _one_place(target: MeasurementSet, reach: float) -> list[str]:
    spread = np.sqrt(((target.position - target.position.mean(axis=0)) ** 2).sum(axis=1).mean())
    if not np.isfinite(reach) or spread > NEAR * reach:
        return []
    return [
        f"all {len(target)} target poses lie within {spread / MM:.3g} mm rms of one place: the "
        "contest does not hold for other parts of the region; spread the poses over it."
    ]
