"""Who won: held-out results compared in pairs, and the sentence that says why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import stdtrit

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import ArchiveError, ObservabilityError
from robotrue.validation.splits import Split

BASELINE: Final = "nominal"
"""The method that assumes an arm without errors. No arm is: it gives way to any gain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateScore:
    """How one method did on held-out poses.

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
    """

    name: str
    n: int
    mean: float
    max: float
    coverage: float
    log_density: float
    mean_by_kind: Mapping[str, float]
    gain: float
    noise: float
    failure: str
    unsettled: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The method chosen and the evidence.

    Attributes:
        winner: Name of the method.
        reason: One sentence with the numbers.
        table: Every candidate, simplest first.
        splits: Names of the splits used.
        rule: How rows were held out and limited, one sentence.
    """

    winner: str
    reason: str
    table: tuple[CandidateScore, ...]
    splits: tuple[str, ...]
    rule: str

    def summary(self) -> Mapping[str, Any]:
        """Returns JSON values for a model's training summary; lengths in m."""
        return {
            "winner": self.winner,
            "reason": self.reason,
            "rule": self.rule,
            "splits": list(self.splits),
            "table": [
                {
                    "name": score.name,
                    "n": score.n,
                    "mean": _json_number(score.mean),
                    "max": _json_number(score.max),
                    "coverage": _json_number(score.coverage),
                    "log_density": _json_number(score.log_density),
                    "mean_by_kind": dict(score.mean_by_kind),
                    "gain": _json_number(score.gain),
                    "noise": _json_number(score.noise),
                    "failure": score.failure,
                    **({"unsettled": True} if score.unsettled else {}),
                }
                for score in self.table
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """Why a candidate has no held-out results.

    Attributes:
        message: Of the error.
        unsettled: Whether the fit did not converge: a fault of the fit, not of the data.
    """

    message: str
    unsettled: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateResults:
    """Held-out results of one candidate: rows of all folds, one after the other.

    Attributes:
        error: (n,) m, length of measured minus predicted.
        inside: Share in the stated 95 % regions.
        log_density: Mean log predictive density.
    """

    error: Array
    inside: float
    log_density: float


def selection_from_summary(summary: Mapping[str, Any]) -> Selection:
    """Returns the selection that :meth:`Selection.summary` wrote, e.g. from a stored model.

    Raises:
        ArchiveError: The values are not those of a selection.
    """
    try:
        return Selection(
            winner=str(summary["winner"]),
            reason=str(summary["reason"]),
            table=tuple(_score_from(row) for row in summary["table"]),
            splits=tuple(summary["splits"]),
            rule=str(summary["rule"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as cause:
        raise ArchiveError(f"the selection in this summary cannot be read: {cause}.") from cause


def _score_from(row: Mapping[str, Any]) -> CandidateScore:
    def number(name: str) -> float:
        return float("nan") if row[name] is None else float(row[name])

    return CandidateScore(
        name=str(row["name"]),
        n=int(row["n"]),
        mean=number("mean"),
        max=number("max"),
        coverage=number("coverage"),
        log_density=number("log_density"),
        mean_by_kind={str(kind): float(mean) for kind, mean in row["mean_by_kind"].items()},
        gain=number("gain"),
        noise=number("noise"),
        failure=str(row["failure"]),
        unsettled=bool(row.get("unsettled", False)),
    )


def decide(
    held: Mapping[str, CandidateResults | Failure],
    folds: Sequence[Split],
    fold_of_row: IntArray,
    rule: str,
) -> Selection:
    """Returns the selection, given every candidate's held-out results or why it has none.

    Args:
        held: By method, simplest first.
        folds: The splits, in the order of ``fold_of_row``.
        fold_of_row: (n,) fold number of each held-out row.
        rule: How rows were held out, for the report.

    Raises:
        ObservabilityError: No candidate has results.
    """
    winner: str | None = None
    best: CandidateResults | None = None
    table, trail = [], []
    for name, result in held.items():
        gain, noise = float("nan"), float("nan")
        if isinstance(result, Failure):
            table.append(_score_failure(name, result))
            trail.append(
                f"{name} " + ("did not converge" if result.unsettled else "could not be fitted")
            )
            continue
        if best is None:
            winner, best = name, result
            trail.append(f"{name} has {result.error.mean() / MM:.3f} mm on held-out poses")
        else:
            twin = _twin(result, held)
            if twin is not None:
                trail.append(f"{name} falls back to {twin}: the same predictions")
                table.append(_score_candidate(name, result, folds, fold_of_row, gain, noise))
                continue
            gain, noise = paired_gain(best.error - result.error, fold_of_row)
            wins = gain > (0.0 if winner == BASELINE else noise)
            verdict = "beats" if wins else "does not beat"
            trail.append(
                f"{name} ({result.error.mean() / MM:.3f} mm) {verdict} {winner}: gain "
                f"{gain / MM:.4f} mm, noise {noise / MM:.4f} mm"
            )
            if wins:
                winner, best = name, result
        table.append(_score_candidate(name, result, folds, fold_of_row, gain, noise))
    if winner is None:
        first = next(iter(held.items()))
        raise ObservabilityError(
            f"no method could be fitted; {first[0]}: {table[0].failure}",
            hint="measure more poses, or name one method to see its full message.",
        )
    return Selection(
        winner=winner,
        reason=f"{winner} is used: " + "; ".join(trail) + ".",
        table=tuple(table),
        splits=tuple(fold.name for fold in folds),
        rule=rule,
    )


def _twin(result: CandidateResults, held: Mapping[str, CandidateResults | Failure]) -> str | None:
    """Name of an earlier candidate with the very same errors: a richer method that fell back."""
    for name, other in held.items():
        if other is result:
            return None
        if isinstance(other, CandidateResults) and np.array_equal(other.error, result.error):
            return name
    return None


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
    name: str,
    result: CandidateResults,
    folds: Sequence[Split],
    fold_of_row: IntArray,
    gain: float,
    noise: float,
) -> CandidateScore:
    kinds = np.array([fold.kind for fold in folds])[fold_of_row]
    return CandidateScore(
        name=name,
        n=len(result.error),
        mean=float(result.error.mean()),
        max=float(result.error.max()),
        coverage=result.inside,
        log_density=result.log_density,
        mean_by_kind={
            kind: float(result.error[kinds == kind].mean())
            for kind in dict.fromkeys(fold.kind for fold in folds)
        },
        gain=gain,
        noise=noise,
        failure="",
    )


def _score_failure(name: str, why: Failure) -> CandidateScore:
    nan = float("nan")
    return CandidateScore(
        name=name,
        n=0,
        mean=nan,
        max=nan,
        coverage=nan,
        log_density=nan,
        mean_by_kind={},
        gain=nan,
        noise=nan,
        failure=why.message,
        unsettled=why.unsettled,
    )


def _json_number(value: float) -> float | None:
    return value if np.isfinite(value) else None
