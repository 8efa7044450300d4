"""Comparison of methods: held-out results in pairs, the reason, and the average of candidates.

An average is one model from the candidates that held-out poses do not exclude.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np
from scipy.special import stdtrit

from robotrue.calibration.averaging import average_models, refuse_strangers
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import (
    RANGES,
    ErrorModel,
    merged_document,
    with_summary,
    with_warnings,
)
from robotrue.core.arrays import Array, IntArray
from robotrue.core.document_decoder import decode
from robotrue.core.json_values import json_values
from robotrue.core.units import MM
from robotrue.errors import ArchiveError, ConvergenceError, ObservabilityError, RobotrueError
from robotrue.validation.splits import Split

BASELINE: Final = "nominal"
"""The method that assumes an arm without errors, as no arm is; any gain replaces it."""
UNKNOWN: Final = float("nan")
PRIOR_ROWS: Final = 1.0
"""Rows spread evenly: every candidate keeps the share that so few rows cannot deny it."""
WEIGHT_STEPS: Final = 300
"""Of expectation and maximisation; each raises the score."""
_RARE: Final = ("unsettled", "stopped")
"""Stated in documents only where they are true."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateScore:
    """Held-out result of one method.

    Attributes:
        name: Method.
        n: Held-out rows scored, over all folds.
        mean: m, mean error; NaN if it could not be fitted.
        max: m, largest error.
        coverage: Share in the stated 95 % regions.
        log_density: Mean log predictive density of a row, log(1/m^3).
        mean_by_kind: m, mean error per kind of split.
        gain: m, mean error of the method chosen before it minus its own; NaN for the first, and for
            one whose predictions are those of a method before it.
        noise: m, what the gain must exceed.
        failure: Why it could not be fitted; empty if it could.
        unsettled: Whether it could not because the fit did not converge.
        stopped: Whether it was fitted, and not held out because it could not win.
    """

    name: str
    n: int = 0
    mean: float = UNKNOWN
    max: float = UNKNOWN
    coverage: float = UNKNOWN
    log_density: float = UNKNOWN
    mean_by_kind: Mapping[str, float] = field(default_factory=dict)
    gain: float = UNKNOWN
    noise: float = UNKNOWN
    failure: str = ""
    unsettled: bool = False
    stopped: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The method chosen and the evidence.

    Attributes:
        winner: Name of the method.
        reason: One sentence with the numbers.
        rule: How rows were held out and limited, one sentence.
        splits: Names of the splits used.
        table: Every candidate, simplest first.
        weights: Share of each candidate in the model, where it is an average; else empty.
    """

    winner: str
    reason: str
    rule: str
    splits: tuple[str, ...]
    table: tuple[CandidateScore, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def summary(self) -> Mapping[str, object]:
        """Returns JSON values for a model's training summary; lengths in m."""
        rows = [
            {name: value for name, value in asdict(row).items() if value or name not in _RARE}
            for row in self.table
        ]
        document: dict[str, object] = {**asdict(self), "table": rows}
        if not self.weights:
            del document["weights"]
        return json_values(document)


def selection_from_summary(summary: Mapping[str, object]) -> Selection:
    """Returns the selection that :meth:`Selection.summary` wrote, e.g. from a stored model.

    Raises:
        ArchiveError: The values are not those of a selection.
    """
    try:
        rows = decode(list[dict[str, object]], summary.get("table"), key="table")
        table = [{key: UNKNOWN if v is None else v for key, v in row.items()} for row in rows]
        return decode(Selection, {**summary, "table": table})
    except ArchiveError as cause:
        message = f"the selection in this summary cannot be read: {cause.message}"
        raise ArchiveError(message, hint=cause.hint) from cause


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateResults:
    """Held-out results of one candidate: rows of all folds, one after the other.

    Attributes:
        error: (n,) m, length of measured minus predicted.
        inside: Share in the stated 95 % regions.
        log_density: Mean log predictive density.
        scores: (n,) log density of each row under Student's law.
    """

    error: Array
    inside: float
    log_density: float
    scores: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppedCandidate:
    """A candidate that was fitted, and not held out because it could not win.

    Attributes:
        reason: With the numbers.
    """

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """Every candidate on every fold.

    Attributes:
        held: By candidate, simplest first: held-out results, or why there are none.
        folds: The splits.
        fold_of_row: (n,) fold of each held-out row.
        rule: How rows were held out, one sentence.
    """

    held: Mapping[str, CandidateResults | StoppedCandidate | RobotrueError]
    folds: tuple[Split, ...]
    fold_of_row: IntArray
    rule: str

    @property
    def scored(self) -> dict[str, CandidateResults]:
        """Candidates that have results."""
        return {k: r for k, r in self.held.items() if isinstance(r, CandidateResults)}

    def gain(self, first: str, second: str) -> tuple[float, float]:
        """Returns :func:`paired_gain` of the second candidate over the first, both m."""
        scored = self.scored
        return paired_gain(scored[first].error - scored[second].error, self.fold_of_row)


def decide(trials: Trials) -> Selection:
    """Returns the selection, given every candidate's held-out results or why it has none.

    Raises:
        ObservabilityError: No candidate has results.
    """
    winner = ""
    table, trail = [], []
    for name, result in trials.held.items():
        gain = noise = UNKNOWN
        if isinstance(result, RobotrueError):
            unsettled = isinstance(result, ConvergenceError)
            table.append(CandidateScore(name=name, failure=result.message, unsettled=unsettled))
            trail.append(f"{name} {'did not converge' if unsettled else 'could not be fitted'}")
            continue
        if isinstance(result, StoppedCandidate):
            table.append(CandidateScore(name=name, failure=result.reason, stopped=True))
            trail.append(result.reason)
            continue
        size = f"{result.error.mean() / MM:.3f} mm"
        if not winner:
            winner = name
            trail.append(f"{name} has {size} on held-out poses")
        elif twin := _find_twin(name, trials):
            trail.append(f"{name} falls back to {twin}: the same predictions")
        else:
            gain, noise = trials.gain(winner, name)
            wins = gain > (0.0 if winner == BASELINE else noise)
            trail.append(
                f"{name} ({size}) {'beats' if wins else 'does not beat'} {winner}: gain "
                f"{gain / MM:.4f} mm, noise {noise / MM:.4f} mm"
            )
            winner = name if wins else winner
        table.append(_score_candidate(name, trials, result, gain, noise))
    if not winner:
        raise ObservabilityError(
            f"no method could be fitted; {next(iter(trials.held))}: {table[0].failure}",
            hint="measure more poses, or name one method to see its full message.",
        )
    return Selection(
        winner=winner,
        reason=f"{winner} is used: " + "; ".join(trail) + ".",
        rule=trials.rule,
        splits=tuple(fold.name for fold in trials.folds),
        table=tuple(table),
    )


def find_voters(trials: Trials, selection: Selection) -> list[str]:
    """Returns the candidates that may have a share in an average, in the order of the contest.

    One that falls back to an earlier candidate adds nothing to it; one that could not be fitted has
    no vote; :data:`BASELINE` has none unless it won.
    """
    return [
        name
        for name in trials.scored
        if not _find_twin(name, trials) and (name != BASELINE or name == selection.winner)
    ]


def drop_excluded(trials: Trials, selection: Selection, names: Sequence[str]) -> list[str]:
    """Returns the names without candidates that the winner beats by more than the noise."""
    kept = []
    for name in names:
        gain, noise = (0.0, 0.0)
        if name != selection.winner:
            gain, noise = trials.gain(name, selection.winner)
        if gain <= noise:
            kept.append(name)
    return kept


def weigh(trials: Trials, selection: Selection, names: Sequence[str]) -> Selection:
    """Returns the selection with the weights of an average over the named candidates."""
    weights = stack_weights([trials.scored[name].scores for name in names])
    shares = dict(zip(names, weights.tolist(), strict=True))
    said = ", ".join(f"{name} {share:.2f}" for name, share in shares.items())
    whose = "none is excluded: the model is their average"
    if len(names) < len(find_voters(trials, selection)):
        whose = "the model is the average of the candidates that are not excluded,"
    reason = (
        f"{selection.reason} With {len(trials.fold_of_row)} held-out poses {whose} by held-out "
        f"density ({said})."
    )
    return replace(selection, reason=reason, weights=shares)


def stack_weights(scores: Sequence[Array]) -> Array:
    """Returns the weight (k,) of each candidate by its density at held-out rows; sum one.

    The weights a maximise sum_i log sum_k a_k p_ik, p_ik the density that candidate k gave row i
    (Yao, Vehtari, Simpson and Gelman 2018): a candidate that is right where the others are wrong
    keeps a share, one that adds nothing loses it.

    Args:
        scores: (n,) log densities of the same held-out rows, one array for each candidate.
    """
    logs = np.stack(scores, axis=1)
    density = np.exp(logs - logs.max(axis=1, keepdims=True))
    rows, count = density.shape
    weights = np.full(count, 1.0 / count)
    for _ in range(WEIGHT_STEPS):
        share = density * weights
        share /= share.sum(axis=1, keepdims=True)
        weights = (share.sum(axis=0) + PRIOR_ROWS / count) / (rows + PRIOR_ROWS)
    return weights


def _find_twin(name: str, trials: Trials) -> str:
    """An earlier candidate with the very same errors, if any: a richer method fell back to it."""
    scored = trials.scored
    earlier = list(scored)[: list(scored).index(name)]
    same = (k for k in earlier if np.array_equal(scored[k].error, scored[name].error))
    return next(same, "")


def paired_gain(difference: Array, fold_of_row: IntArray) -> tuple[float, float]:
    """Returns the mean of paired differences and the noise it must exceed to count, both in m.

    The mean of the fold means, and its one-sided 95 % Student half width over the folds. Rows of
    one fold are not independent: they share a fit and a region.

    Args:
        difference: (n,) m, error of the simpler minus error of the richer method.
        fold_of_row: (n,) fold number of each row, 0 .. k - 1, k >= 2 or n >= 2.
    """
    count = int(fold_of_row.max()) + 1
    if count < 2:  # one split only: its rows are all there is
        fold_of_row, count = np.arange(len(difference)), len(difference)
    means = np.bincount(fold_of_row, weights=difference) / np.bincount(fold_of_row)
    if count < 2:
        return float(means.mean()), float("inf")
    error = float(means.std(ddof=1)) / np.sqrt(count)
    return float(means.mean()), float(stdtrit(count - 1, 0.95)) * float(error)


def _score_candidate(
    name: str, trials: Trials, result: CandidateResults, gain: float, noise: float
) -> CandidateScore:
    kinds = np.array([fold.kind for fold in trials.folds])[trials.fold_of_row]
    return CandidateScore(
        name=name,
        n=len(result.error),
        mean=float(result.error.mean()),
        max=float(result.error.max()),
        coverage=result.inside,
        log_density=result.log_density,
        mean_by_kind={
            kind: float(result.error[kinds == kind].mean())
            for kind in dict.fromkeys(fold.kind for fold in trials.folds)
        },
        gain=gain,
        noise=noise,
    )


FitWhole: TypeAlias = Callable[[], ErrorModel]
"""Fits a candidate on all rows."""


def average_candidates(
    model: CalibratedModel,
    others: Mapping[str, FitWhole],
    trials: Trials,
    selection: Selection,
) -> tuple[ErrorModel, Selection]:
    """Returns the average of the winner and other candidates, and the selection with its weights.

    Weights are those of the held-out density; the summary is the winner's, with the origins and
    the region of all. A candidate that is no arm with terms has no share; one that cannot be
    averaged with the winner is named.

    Args:
        model: The winner, fitted on all rows.
        others: The other candidates with a vote.
        trials: Held-out results of all.
        selection: The contest.
    """
    models = {selection.winner: model}
    doubts: list[str] = []
    for name, fit in others.items():
        try:
            other = fit()
            if isinstance(other, CalibratedModel):
                refuse_strangers([*models.values(), other])
                models[name] = other
        except RobotrueError as cause:
            doubts.append(f"{name} is left out of the average: {cause.message}")
    if len(models) < 2:
        return with_warnings(model, doubts), selection
    weighed = weigh(trials, selection, [name for name in trials.scored if name in models])
    weights = np.array([weighed.weights[name] for name in models])
    average = with_summary(
        average_models(list(models.values()), weights), _merge_origins(list(models.values()))
    )
    return with_warnings(average, doubts), weighed


def _merge_origins(models: Sequence[CalibratedModel]) -> dict[str, object]:
    """JSON values of where the data of all models come from, and of the region they cover."""
    merged: dict[str, object] = {"provenance": merged_document(models)}
    summaries = [model.training_summary() for model in models]
    for name in RANGES:
        stated = [np.asarray(summary.get(name, ()), dtype=np.float64) for summary in summaries]
        known = [values for values in stated if values.ndim == 2 and len(values) == 2]
        if known and len(stated[0]) == 2:
            both = np.vstack(known)
            merged[name] = [both.min(axis=0).tolist(), both.max(axis=0).tolist()]
    return merged
