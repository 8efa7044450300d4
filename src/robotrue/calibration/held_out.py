"""How far off, and how sure, the learned model is on blocks of rows it did not see.

Within the training rows alone: the rows are cut into contiguous blocks in the order they were
measured, each block is predicted from the others at the learned scales (taking its sums away and
solving again, no refit of scales), and the covariance is multiplied by the factor that makes 95 %
of the rows fall into their 95 % region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.design import Design
from robotrue.calibration.evidence import Sums, Weights, posterior, spread
from robotrue.calibration.robust import chi_point
from robotrue.core.arrays import Array

BLOCKS: Final = 10
LEVEL: Final = 0.95
LARGEST: Final = 100.0
"""Largest factor on a covariance: ten times the standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Rows predicted from the other blocks, base or tracker frame, in the rows' order.

    Attributes:
        error: (n, 3) m, measured minus predicted.
        model: (n, 3, 3) m^2, parameters, residual and white noise.
        instrument: (n, 3, 3) m^2.
        inflation: Factor on ``model`` for the stated coverage.
    """

    error: Array
    model: Array
    instrument: Array
    inflation: float

    @property
    def mean(self) -> float:
        """Mean 3-D error, m."""
        return float(np.linalg.norm(self.error, axis=1).mean())

    def coverage(self, factor: float) -> float:
        """Returns the share of rows in their 95 % region, the model's part times ``factor``."""
        return float((_squared(self, factor) <= chi_point(LEVEL, 3) ** 2).mean())


def held_out(
    design: Design, sums: Sequence[Sums], fit: Weights, uncarried: Array, repeatability: float
) -> HeldOut:
    """Returns every row predicted from the other blocks, and the factor on the covariance.

    Args:
        design: The linear model.
        sums: Of all rows.
        fit: At the learned scales.
        uncarried: (rows,) m^2, variance of the smooth residual that its centres do not carry.
        repeatability: m, sd per axis, part of the rows' stated covariance.
    """
    count = len(design.weights)
    blocks = min(BLOCKS, max(2, count // 6))
    fold = np.arange(count) * blocks // count
    error, model, instrument = np.zeros((count, 3)), *np.zeros((2, count, 3, 3))
    for k in range(blocks):
        chosen = fold == k
        rest = [a.without(b) for a, b in zip(sums, design.sums(chosen), strict=True)]
        weights = posterior(rest, fit.groups, fit.noise)
        for item in design.rows(chosen):
            lower = item.lower[:, :3, :3]
            columns = item.columns[:, :3]
            off = item.values[:, :3] - columns @ weights.mean
            error[item.rows] = (lower @ off[:, :, None])[:, :, 0]
            back = np.swapaxes(lower, 1, 2)
            noise = fit.noise[0] * lower @ back
            known = item.instrument[:, :3, :3] - repeatability**2 * np.eye(3)
            model[item.rows] = lower @ spread(weights.root, columns) @ back + noise - known
            instrument[item.rows] = known
    model += uncarried[:, None, None] * np.eye(3)
    found = HeldOut(error=error, model=model, instrument=instrument, inflation=1.0)
    return HeldOut(error=error, model=model, instrument=instrument, inflation=_factor(found))


def _squared(found: HeldOut, factor: float) -> Array:
    covariance = factor * found.model + found.instrument
    solved = np.linalg.solve(covariance, found.error[:, :, None])[:, :, 0]
    squared: Array = (found.error * solved).sum(axis=1)
    return squared


def _factor(found: HeldOut) -> float:
    """Bisection in the logarithm; coverage grows with the factor."""
    low, high = -np.log(4.0), np.log(LARGEST)
    for _ in range(40):
        middle = 0.5 * (low + high)
        if found.coverage(float(np.exp(middle))) < LEVEL:
            low = middle
        else:
            high = middle
    return float(np.exp(high))
