"""Accuracy and coverage against the number of target poses, for every candidate of a transfer.

In every repeat the target rows are shuffled: the last ones are held out from all, the first n are
given to the candidates, so that fewer poses are always part of more (nested subsets).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.json_values import json_values
from robotrue.core.progress import Progress
from robotrue.core.units import MM
from robotrue.errors import RobotrueError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import evaluate
from robotrue.validation.guard import Candidate
from robotrue.validation.metrics import coverage

COUNTS: Final = (0, 5, 10, 20, 40)
"""Numbers of target poses of a curve."""
FEWEST_HELD: Final = 10
"""Fewest target rows to test on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningCurve(Columns):
    """Held-out error of every candidate against the number of target poses.

    Attributes:
        names: (c,) candidates.
        counts: (k,) numbers of target poses, rising.
        mean: (c, k, r) m, mean error on the held-out target rows in each of r repeats; NaN where
            the candidate could not be fitted.
        coverage: (c, k, r) share of them in the stated 95 % regions; NaN likewise.
        held: Number of rows each repeat is tested on.
        floor: m, the mean error nothing can beat, if it is known.
        failures: Why, for every candidate that failed at some count: name and first reason.
    """

    names: Annotated[tuple[str, ...], Column("c")]
    counts: Annotated[IntArray, Column("k")]
    mean: Annotated[Array, Column("c k _", unit="m", nan=True)]
    coverage: Annotated[Array, Column("c k _", nan=True)]
    held: int
    floor: float | None = None
    failures: tuple[str, ...] = ()

    @property
    def repeats(self) -> int:
        """Number of repeats."""
        return int(self.mean.shape[2])

    def quartiles(self) -> Array:
        """Returns (3, c, k) m: lower quartile, median and upper quartile of ``mean``.

        NaN where a candidate was fitted in fewer than half of the repeats.
        """
        return _quartiles(self.mean)

    def to_json(self) -> dict[str, object]:
        """Returns JSON values, lengths in mm, one entry per candidate and count."""
        error, inside = self.quartiles() / MM, _quartiles(self.coverage)
        return json_values(
            {
                "counts": self.counts,
                "held_out": self.held,
                "repeats": self.repeats,
                "floor_mm": None if self.floor is None else self.floor / MM,
                "failures": self.failures,
                "candidates": {
                    name: {
                        "median_mm": error[1, c],
                        "lower_quartile_mm": error[0, c],
                        "upper_quartile_mm": error[2, c],
                        "coverage_95": inside[1, c],
                    }
                    for c, name in enumerate(self.names)
                },
            }
        )


def learning_curve(
    candidates: Mapping[str, Candidate],
    target: MeasurementSet,
    *,
    counts: Sequence[int] = COUNTS,
    repeats: int = 5,
    payload: Load | None = None,
    floor: float | None = None,
    test: MeasurementSet | None = None,
    progress: Progress | None = None,
) -> LearningCurve:
    """Returns the error of every candidate with 0, 5, 10, 20, 40 target poses.

    Args:
        candidates: As of the guard.
        target: Target rows; without ``test`` the largest count leaves at least
            :data:`FEWEST_HELD` of them to test on, larger counts are left out.
        counts: Numbers of target poses.
        repeats: Random nested subsets.
        payload: Used where a row does not state its own.
        floor: m, lower bound of the error, if it is known.
        test: Rows to test on instead, never given to a candidate.
        progress: Called before every fit.

    Raises:
        ShapeError: No candidates, no repeats, or too few target rows for any count.
    """
    n = len(target)
    room = n if test is not None else n - FEWEST_HELD
    used = np.array(sorted({int(c) for c in counts if 0 <= c <= room}), dtype=np.int64)
    if not candidates or repeats < 1 or not len(used):
        raise ShapeError(
            f"no curve from {n} target rows, {len(candidates)} candidates and {repeats} repeats.",
            hint=f"{FEWEST_HELD} target rows are held out; measure more.",
        )
    rng = np.random.default_rng([0, 43])
    orders = [rng.permutation(n) for _ in range(repeats)]
    shape = (len(candidates), len(used), repeats)
    mean, inside = np.full(shape, np.nan), np.full(shape, np.nan)
    failures: dict[str, str] = {}
    done = 0
    for r, order in enumerate(orders):
        held = target.subset(order[int(used[-1]) :]) if test is None else test
        for c, (name, fit) in enumerate(candidates.items()):
            for k, count in enumerate(used):
                if progress is not None:
                    progress(f"{name}, {count} target poses", done, mean.size)
                done += 1
                rows = target.subset(order[:count]) if count else None
                try:
                    mean[c, k, r], inside[c, k, r] = _score_model(fit(rows), held, payload)
                except RobotrueError as cause:
                    failures.setdefault(name, f"{name}, {count} target poses: {cause.message}")
    return LearningCurve(
        names=tuple(candidates),
        counts=used,
        mean=mean,
        coverage=inside,
        held=n - int(used[-1]) if test is None else len(test),
        floor=floor,
        failures=tuple(failures.values()),
    )


def _score_model(
    model: ErrorModel, held: MeasurementSet, payload: Load | None
) -> tuple[float, float]:
    seen = evaluate(model, held, payload=payload)
    error = float(np.linalg.norm(seen.after, axis=1).mean())
    return error, coverage(seen.after, seen.covariance).share


def _quartiles(values: Array) -> Array:
    """(3, c, k) quartiles over the last axis; NaN where fewer than half are numbers."""
    out = np.full((3, *values.shape[:2]), np.nan)
    enough = np.isfinite(values).mean(axis=2) >= 0.5
    out[:, enough] = np.nanpercentile(values[enough], (25.0, 50.0, 75.0), axis=1)
    return out
