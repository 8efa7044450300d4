"""How far off, and how sure, the learned model is on blocks of rows it did not see.

Within the training rows alone: the rows are cut into contiguous blocks in the order they were
measured; the scales, the noise and the weights are learned anew without each block, which is then
predicted. The covariance gets the factor that makes 95 % of the held-out rows fall into their 95 %
region. With few rows that factor is a matter of chance; it is then drawn towards the one of
Student's law for a variance known from as many numbers as are left.
What stays common to all blocks: linearisation, robust weights, and the lengths of the smooth part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.design import Design
from robotrue.calibration.evidence import Sums, Weights, learn, spread
from robotrue.calibration.robust import LEVEL, chi_point, student_factor
from robotrue.core.arrays import Array

BLOCKS: Final = 5
"""As in validation: a contiguous fifth is held out at a time."""
STEPS: Final = 6
"""Of learning without a block, from the scales of all rows."""
PRIOR_ROWS: Final = 60
"""Rows at which the factor of the blocks and that of Student's law count alike: with 60 rows the
95 % point rests on three of them."""
MANY: Final = 200
"""Rows from which the factor of the blocks may be below one: ten of them make the 95 % point."""
LEAST_FREEDOM: Final = 6.0
"""Degrees below which Student's law says nothing sensible of three numbers."""
LARGEST: Final = 100.0
"""Largest factor on a covariance: ten times the standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Rows predicted from the other blocks, base or tracker frame, in the rows' order.

    Attributes:
        error: (n, 3) m, measured minus predicted.
        learned: (n, 3, 3) m^2, parameters and residual.
        white: (n, 3, 3) m^2, repeatability and white noise.
        instrument: (n, 3, 3) m^2.
        inflation: Factor on ``learned + white``.
    """

    error: Array
    learned: Array
    white: Array
    instrument: Array
    inflation: float = 1.0

    @property
    def mean(self) -> float:
        """Mean 3-D error, m."""
        return float(np.linalg.norm(self.error, axis=1).mean())

    @property
    def coverage(self) -> float:
        """Share of rows in their 95 % region."""
        covariance = self.inflation * (self.learned + self.white) + self.instrument
        solved = np.linalg.solve(covariance, self.error[:, :, None])[:, :, 0]
        squared = (self.error * solved).sum(axis=1)
        return float((squared <= chi_point(LEVEL, 3) ** 2).mean())


def predict_held_out(
    design: Design,
    sums: Sequence[Sums],
    fit: Weights,
    uncarried: Array,
    repeatability: float,
    *,
    shift: float = 0.0,
) -> HeldOut:
    """Returns every row predicted from the other blocks, and the factor on the covariance.

    Args:
        design: The linear model.
        sums: Of all rows.
        fit: At the learned scales.
        uncarried: (rows,) m^2, variance of the smooth residual that its centres do not carry.
        repeatability: m, sd per axis, part of the rows' stated covariance.
        shift: m, sd per axis by which blocks may stand apart for the time between them alone.
    """
    count = len(design.weights)
    blocks = min(BLOCKS, max(2, count // 6))
    fold = np.arange(count) * blocks // count
    error, learned, white, instrument = (
        np.zeros((count, 3)),
        *np.zeros((3, count, 3, 3)),
    )
    for k in range(blocks):
        chosen = fold == k
        if all(s.few for s in sums):
            rest = design.sums(~chosen)
        else:
            rest = [a.without(b) for a, b in zip(sums, design.sums(chosen), strict=True)]
        others = learn(rest, fit.groups, fit.noise, steps=STEPS)
        for item in design.rows(chosen):
            lower, columns = item.lower[:, :3, :3], item.columns[:, :3]
            back = np.swapaxes(lower, 1, 2)
            off = item.values[:, :3] - columns @ others.mean
            known = item.instrument[:, :3, :3] - repeatability**2 * np.eye(3)
            error[item.rows] = (lower @ off[:, :, None])[:, :, 0]
            learned[item.rows] = lower @ spread(others.root, columns) @ back
            white[item.rows] = others.noise[0] * lower @ back - known
            instrument[item.rows] = known + shift**2 * np.eye(3)
    learned += uncarried[:, None, None] * np.eye(3)
    return _covering(HeldOut(error=error, learned=learned, white=white, instrument=instrument))


def temper_factor(found: HeldOut, freedom: float) -> HeldOut:
    """Returns the same with a factor that few rows cannot throw about.

    Its logarithm is the mean of that of the blocks, with the weight of the rows, and that of
    Student's law with ``freedom`` degrees, with the weight of :data:`PRIOR_ROWS`. Blocks that all
    lie inside make nothing narrower before there are :data:`MANY` rows: of twenty that is expected.

    Args:
        found: From :func:`predict_held_out`.
        freedom: Numbers measured beyond those the weights took.
    """
    rows = len(found.error)
    share = rows / (rows + PRIOR_ROWS)
    blocks = float(np.log(found.inflation))
    if rows < MANY:
        blocks = max(blocks, 0.0)
    law = float(np.log(student_factor(max(freedom, LEAST_FREEDOM))))
    return replace(found, inflation=float(np.exp(share * blocks + (1.0 - share) * law)))


def _covering(found: HeldOut) -> HeldOut:
    """Returns the factor by bisection in its logarithm; coverage grows with it."""
    low, high = -np.log(4.0), np.log(LARGEST)
    for _ in range(30):
        middle = 0.5 * (low + high)
        if replace(found, inflation=float(np.exp(middle))).coverage < LEVEL:
            low = middle
        else:
            high = middle
    return replace(found, inflation=float(np.exp(high)))
