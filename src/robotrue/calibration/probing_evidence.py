"""Evidence in touches: their consistency, the error of this arm, and their noise.

Touch i is compared with what all others say of it
(:func:`robotrue.calibration.new_rows.left_out_lengths`). A bound then needs no guess of how much
the arm may err: that is in the covariance of all numbers, larger for a nominal arm, smaller for a
calibrated one and for touches of one neighbourhood.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.drift_scales import Stack
from robotrue.calibration.evidence import COMMON_HOLD, PriorGroup, Weights, learn, sums_of
from robotrue.calibration.new_rows import left_out_lengths
from robotrue.calibration.priors import LEARNED, Prior
from robotrue.calibration.robust import chi_point, student_factor
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.graduated import agreeing

FALSE_ALARM: Final = 0.01
"""Chance that a set without a wrong touch loses one."""
FAINT: Final = 1e-6
"""Weight of a touch that is not believed: its own number then says nothing."""


def surprise(stack: Stack, belief: Belief, noise: Array) -> float:
    """Returns the distance of the rows from the prior, relative to the expected distance.

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


BANDS: Final = (1, 4, 9, 17, 33)
"""First N of each band of ripple that has a scale of its own."""
HOLD: Final = 0.5
"""Of each scale to its default: a factor of e is one sigma."""
STEPS: Final = 40
WORTH: Final = 8.0
"""Weights that the default scales are worth: with 4, regions after 12 touches hold too much."""


def learn_scales(
    belief: Belief, stack: Stack, noise: Array, physical: Prior
) -> tuple[Belief, float]:
    """Returns the prior of a nominal arm with scales as the touches ask, and their noise factor.

    Groups: the learnable ones of the physical prior and the bands of ripple. All are held to their
    default: thirty touches say little of a group, but they say what all have in common. A scale
    told by few is not a scale known, so the belief's inflation grows (:func:`few_factor`).

    Args:
        belief: Diagonal prior of the arm, the frames at its end.
        stack: The believed rows.
        noise: (2,) white variance of lengths and angles.
        physical: Names the groups of the robot errors.
    """
    sd = np.sqrt(belief.variance)
    waves, end = belief.place("ripple"), belief.end
    ripple, backlash = waves.start, waves.stop
    groups: list[PriorGroup] = []
    number = np.asarray(physical.group[:ripple])
    for k in np.unique(number[sd[:ripple] > 0.0]).tolist():
        columns = np.flatnonzero((number == k) & (sd[:ripple] > 0.0))
        name = "fixed" if k < 0 else LEARNED[int(k)]
        groups.append(_group(name, columns, sd, held=k >= 0))
    order = belief.ripple.order
    for low, high in pairwise(BANDS):
        columns = ripple + np.flatnonzero((order >= low) & (order < high))
        if len(columns):
            groups.append(_group(f"ripple/{low}", columns, sd, held=True))
    others = np.flatnonzero(sd[backlash:end] > 0.0) + backlash
    if len(others):
        groups.append(_group("other", others, sd, held=False))
    groups.append(_group("frames", np.arange(end, len(sd)), sd, held=False))
    found = _learn(stack.columns, stack, belief.mean, noise, groups)
    new = np.zeros(len(sd))
    for group in found.groups:
        new[group.columns] = group.sd * group.unit
    told = sum(
        float(seen) for g, seen in zip(found.groups, found.determined, strict=True) if g.learned
    )
    # What the touches determine hardly depends on the scales; what they do not (a side that was
    # never touched) is as uncertain as the scales themselves, which the default holds loosely.
    # A scale that was lowered is widened so far, but not beyond the default.
    beyond = float(np.sqrt(few_factor(told, COMMON_HOLD) / few_factor(told)))
    for group in found.groups:
        if group.learned:
            new[group.columns] *= max(min(beyond, 1.0 / group.sd), 1.0)
    wider = replace(
        belief, root=np.diag(new)[new > 0.0], inflation=belief.inflation * few_factor(told)
    )
    return wider, float(found.noise[0])


def few_factor(told: float, worth: float = WORTH) -> float:
    """Returns the factor on a covariance whose scale was told by some weights.

    Args:
        told: Number of weights of learned groups that the touches determine.
        worth: Weights that the default scales are worth.
    """
    return student_factor(told + worth)


def noise_factor(belief: Belief, stack: Stack, noise: Array) -> float:
    """Returns by how much the touches' variance is larger than stated; never below 1."""
    unit = stack.columns @ belief.root.T
    group = PriorGroup(name="all", columns=np.arange(unit.shape[1]), sd=1.0)
    offset = replace(stack, values=stack.values - stack.columns @ belief.mean)
    return float(_learn(unit, offset, np.zeros(unit.shape[1]), noise, [group]).noise[0])


def _group(name: str, columns: IntArray, sd: Array, *, held: bool) -> PriorGroup:
    return PriorGroup(
        name=name,
        columns=np.asarray(columns, dtype=np.int64),
        sd=1.0,
        rest=1.0 if held else 0.0,
        shape=sd[columns],
        hold=HOLD if held else 0.0,
    )


def _learn(
    columns: Array, stack: Stack, mean: Array, noise: Array, groups: list[PriorGroup]
) -> Weights:
    lower = np.linalg.cholesky(stack.known + np.diag(noise[0] * stack.white))
    values = np.linalg.solve(lower, stack.values - columns @ mean)
    rows = np.linalg.solve(lower, columns)
    sums = sums_of([(rows, values, float(len(values)))], columns.shape[1])
    return learn([replace(sums, least=1.0)], groups, np.ones(1), steps=STEPS)
