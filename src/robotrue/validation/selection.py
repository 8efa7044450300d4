"""Which method to use: the simplest one that nothing richer beats on poses held back.

Candidates come simplest first. Each is fitted on the training part of every split and scored on the
held-out part. A richer one replaces the one chosen so far only if its mean held-out error is lower
by more than the noise: the one-sided 95 % Student interval of the paired differences, taken over
folds because rows of one fold share their fit and their place.

Cost is bounded by rule, not by luck: at most :data:`MOST_TRAIN` rows fit a fold and at most
:data:`MOST_TEST` score it, evenly spaced; the winner is refitted on all rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from scipy.special import stdtrit

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import ObservabilityError, RobotrueError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage, log_density
from robotrue.validation.splits import (
    Split,
    contiguous_blocks,
    leave_one_set_out,
    random_folds,
    spatial_regions,
)

FitFunction: TypeAlias = Callable[[MeasurementSet], ErrorModel]
"""Fits a model on the rows it is given."""
Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with what is done next, the number of fits done, and their total."""

MOST_TRAIN: Final = 1500
MOST_TEST: Final = 500
FEW_ROWS: Final = 40
"""Below this every row is held out by itself: blocks would leave too little to fit on."""
REGION_ROWS: Final = 120
"""From here on regions of the workspace are held out too."""


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
        gain: m, mean error of the method chosen before it minus its own; NaN for the first.
        noise: m, what the gain must exceed.
        failure: Why it could not be fitted; empty if it could.
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
                }
                for score in self.table
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Held:
    """Held-out results of one candidate: rows of all folds, one after the other."""

    error: Array
    inside: float
    log_density: float


def default_splits(measurements: MeasurementSet) -> tuple[Split, ...]:
    """Returns the splits ``select`` uses when none are given.

    Fewer than 40 rows: every row by itself. From 40: five blocks of rows, three from 3,000 on (to
    save fits). From 120: also three regions of the workspace. Several sets: also each set, when
    every one leaves at least 40 rows to fit on.
    """
    n = len(measurements)
    if n < FEW_ROWS:
        return random_folds(n, folds=n)
    splits = contiguous_blocks(n, blocks=5 if n < 3000 else 3)
    if n >= REGION_ROWS:
        splits += spatial_regions(measurements, count=3)
    # Only where stations are known: a held-out tracker set-up cannot be placed in base.
    if measurements.frame == "base" and len(np.unique(measurements.group)) > 1:
        by_set = leave_one_set_out(measurements)
        if len(by_set) <= 5 and min(len(s.train) for s in by_set) >= FEW_ROWS:
            splits += by_set
    return splits


def select(
    candidates: Mapping[str, FitFunction],
    measurements: MeasurementSet,
    *,
    splits: Sequence[Split] | None = None,
    payload: Load | None = None,
    progress: Progress | None = None,
) -> Selection:
    """Returns the simplest candidate that no richer one beats on held-out poses.

    Args:
        candidates: Fit functions, simplest first.
        measurements: All rows.
        splits: What to hold out; :func:`default_splits` if None.
        payload: Used where a row does not state its own.
        progress: Told before every fit.

    Raises:
        ShapeError: No candidates or no splits.
        ObservabilityError: No candidate could be fitted; the message carries the first reason.
    """
    folds = tuple(default_splits(measurements) if splits is None else splits)
    if not candidates or not folds:
        raise ShapeError("nothing to select from: no candidates or no splits.")
    held: dict[str, _Held | str] = {}
    parts = [(_spaced(f.train, MOST_TRAIN), _spaced(f.test, MOST_TEST)) for f in folds]
    total = len(candidates) * len(folds)
    for index, (name, fit) in enumerate(candidates.items()):
        try:
            results = []
            for k, (train, test) in enumerate(parts):
                if progress is not None:
                    progress(f"{name}, {folds[k].name}", index * len(folds) + k, total)
                model = fit(measurements.subset(train))
                results.append(evaluate(model, measurements.subset(test), payload=payload))
            error = np.concatenate([np.linalg.norm(r.after, axis=1) for r in results])
            residual = np.concatenate([r.after for r in results])
            covariance = np.concatenate([r.covariance for r in results])
            held[name] = _Held(
                error=error,
                inside=coverage(residual, covariance).share,
                log_density=float(log_density(residual, covariance).mean()),
            )
        except RobotrueError as cause:
            held[name] = cause.message
    if progress is not None:
        progress("chosen", total, total)
    fold_of_row = np.repeat(np.arange(len(parts)), [len(test) for _, test in parts])
    return _choose(held, folds, fold_of_row, _rule(folds, parts))


def _choose(
    held: Mapping[str, _Held | str], folds: Sequence[Split], fold_of_row: IntArray, rule: str
) -> Selection:
    winner: str | None = None
    best: _Held | None = None
    table, trail = [], []
    for name, result in held.items():
        gain, noise = float("nan"), float("nan")
        if isinstance(result, str):
            table.append(_failed(name, result))
            trail.append(f"{name} could not be fitted")
            continue
        if best is None:
            winner, best = name, result
            trail.append(f"{name} has {result.error.mean() / MM:.3f} mm on held-out poses")
        else:
            gain, noise = paired_gain(best.error - result.error, fold_of_row)
            wins = gain > noise
            verdict = "beats" if wins else "does not beat"
            trail.append(
                f"{name} ({result.error.mean() / MM:.3f} mm) {verdict} {winner}: gain "
                f"{gain / MM:.4f} mm, noise {noise / MM:.4f} mm"
            )
            if wins:
                winner, best = name, result
        table.append(_scored(name, result, folds, fold_of_row, gain, noise))
    if winner is None:
        first = next(iter(held.items()))
        raise ObservabilityError(
            f"no method could be fitted; {first[0]}: {first[1]}",
            hint="measure more poses, or name one method to see its full message.",
        )
    return Selection(
        winner=winner,
        reason=f"{winner} is used: " + "; ".join(trail) + ".",
        table=tuple(table),
        splits=tuple(fold.name for fold in folds),
        rule=rule,
    )


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


def _scored(
    name: str,
    result: _Held,
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


def _failed(name: str, why: str) -> CandidateScore:
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
        failure=why,
    )


def _spaced(rows: IntArray, most: int) -> IntArray:
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]


def _rule(folds: Sequence[Split], parts: Sequence[tuple[IntArray, IntArray]]) -> str:
    counts = {
        kind: sum(f.kind == kind for f in folds) for kind in dict.fromkeys(f.kind for f in folds)
    }
    what = " and ".join(f"{count} {kind}" for kind, count in counts.items())
    most_train, most_test = max(len(a) for a, _ in parts), max(len(b) for _, b in parts)
    return (
        f"held out: {what}; up to {most_train} rows fit and {most_test} score each fold, evenly "
        "spaced; a richer method must win by more than the one-sided 95 % interval over folds"
    )


def _json_number(value: float) -> float | None:
    return value if np.isfinite(value) else None
