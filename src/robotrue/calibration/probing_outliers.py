"""Which touches agree, judged by how well the others predict each, the arm's own error included.

Touch i is compared with what all others say of it
(:func:`robotrue.calibration.conditioning.left_out_lengths`). A bound then needs no guess of how
much the arm may err: that is in the covariance of all numbers, larger for a nominal arm, smaller
for a calibrated one and for touches of one neighbourhood.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.conditioning import left_out_lengths
from robotrue.calibration.drift_scales import Stack
from robotrue.calibration.robust import chi_point
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.graduated import agreeing

FALSE_ALARM: Final = 0.01
"""Chance that a set without a wrong touch loses one."""
FAINT: Final = 1e-6
"""Weight of a touch that is not believed: its own number then says nothing."""


def surprise(stack: Stack, belief: Belief, noise: Array) -> float:
    """Returns how far the rows lie from what was believed, over how far they were expected to.

    About 1 where belief and noise hold; the frames, of which nothing was known, take their share.
    NaN where nothing is left over.
    """
    freedom = len(stack.values) - belief.nuisances
    if freedom < 1:
        return float("nan")
    half = stack.columns @ belief.root.T
    offset = stack.values - stack.columns @ belief.mean
    total = half @ half.T + stack.known + np.diag(noise[0] * stack.white)
    return float(np.sqrt(offset @ np.linalg.solve(total, offset) / freedom))


def find_agreeing_touches(stack: Stack, belief: Belief, noise: Array, tested: int) -> BoolArray:
    """Returns which of the first ``tested`` rows agree.

    Args:
        stack: All rows, the touches first.
        belief: Of the arm and, at its end, the frames.
        noise: (2,) white variance of lengths and angles.
        tested: Number of touches; the rows behind them are believed.

    Raises:
        ConvergenceError: Weights that never settle.
    """
    half = stack.columns @ belief.root.T
    shared = half @ half.T
    offset = stack.values - stack.columns @ belief.mean
    own = stack.known + np.diag(noise[0] * stack.white)
    rows = [np.flatnonzero(stack.row == i) for i in range(tested)]
    level = 1.0 - FALSE_ALARM / max(tested, 1)
    bound = np.array([chi_point(level, len(mine)) for mine in rows])

    def lengths(weights: Array) -> Array:
        weight = np.ones(int(stack.row.max()) + 1)
        weight[:tested] = np.maximum(weights, FAINT)
        root = 1.0 / np.sqrt(weight[stack.row])
        noisier = own * root[:, None] * root
        found = left_out_lengths(shared + noisier, offset, rows, own - noisier)
        return np.asarray(found / np.sqrt(belief.inflation) / bound)

    return agreeing(lengths, tested, 1.0)
