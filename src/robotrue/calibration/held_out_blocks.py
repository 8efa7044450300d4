"""Held-out error and coverage of a linear model, and the width factor that follows.

Within the training rows alone: the rows are cut into contiguous blocks in the order they were
measured; the scales, the noise and the weights are learned again without each block, which is then
predicted. Common to all blocks are linearisation, robust weights, and the lengths of the smooth
part.

From :data:`MANY` rows each block is learned from initial scales, like any held-out part, and serves
as one in the choice of the method: learning that begins at the scales of all rows retains some of
the block.

The covariance gets one factor f from these predictions. A factor is a variance, which few rows
determine poorly: with a prior of :data:`PRIOR_NUMBERS` numbers about one it is where

    sum (r' C^-1 V C^-1 r - tr C^-1 V) + PRIOR_NUMBERS (1 / f - 1) = 0,    V = f (learned + white)

with C = V + instrument, and the 95 % region is that of Student's law on as many degrees as there
are rows left: the three numbers of a row share their cause, so a row counts once. With many rows
the 95 % point of the rows themselves is used, for any distribution.

Several models of the same rows, averaged, get one factor together, from the average of their
predictions of the blocks. A factor of each is not enough: errors of models that differ cancel in
their average, so that it is more accurate than its members while the spread between them makes it
wider (the ambiguity decomposition of Krogh and Vedelsby 1995). Averages are of few rows, whose
factor is mostly chance: there a row counts once against the prior too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.design import Design, WhitenedRows
from robotrue.calibration.evidence import Sums, Weights
from robotrue.calibration.scale_learning import find_scales
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.robust import CUT, LEVEL, chi_point, student_factor

BLOCKS: Final = 5
"""As in validation: a contiguous fifth is held out at a time."""
STEPS: Final = 6
"""Of learning without a block, from the scales of all rows."""
REFIT_STEPS: Final = 12
"""Of learning without some rows, from initial scales."""
LEAST_GAIN: Final = 3.0
"""Log evidence that a step of it must gain for another: 20 to 1, as a richer model must."""
PRIOR_NUMBERS: Final = 20.0
"""Weight of the prior of the factor, in numbers."""
NUMBERS_PER_ROW: Final = 3.0
"""Of a position, which share one cause."""
QUANTILE_ROWS: Final = 300
"""Rows at which the 95 % point of the rows and the variance of their misfit count alike."""
MANY: Final = 200
"""Rows from which their 95 % point may make a region smaller: ten of them make that point."""
LEAST_FREEDOM: Final = 8.0
"""Degrees below which Student's law is not meaningful for three numbers."""
LARGEST: Final = 100.0
"""Largest factor on a covariance: ten times the standard deviation."""
SMALLEST: Final = 1.0 / 16.0
"""Smallest: a quarter of the standard deviation."""
HALF: Final = 0.5
"""Weights of a group that the data determine from which its scale is taken for learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedScales:
    """Scales and noise of a fit without some rows.

    Attributes:
        scales: By the name of the group.
        noise: (c,) tau of each channel.
        freedom: That the width of the fit rests on; see :func:`count_freedom`.
    """

    scales: Mapping[str, float]
    noise: Array
    freedom: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutRows:
    """Rows predicted from the other blocks, base or tracker frame, in the rows' order.

    Attributes:
        error: (n, 3) m, measured minus predicted.
        learned: (n, 3, 3) m^2, parameters and residual.
        white: (n, 3, 3) m^2, repeatability and white noise.
        instrument: (n, 3, 3) m^2.
        counted: (n,) rows that are not screened out.
        freedom: That the width of the fit rests on; see :func:`count_freedom`.
        inflation: Factor on ``learned + white``.
        fits: The fit without each block, where those began at initial scales.
    """

    error: Array
    learned: Array
    white: Array
    instrument: Array
    counted: BoolArray
    freedom: float = np.inf
    inflation: float = 1.0
    fits: tuple[LearnedScales, ...] = ()

    def part(self, chosen: BoolArray) -> HeldOutRows:
        """Returns some of the rows (n,)."""
        return replace(
            self,
            error=self.error[chosen],
            learned=self.learned[chosen],
            white=self.white[chosen],
            instrument=self.instrument[chosen],
            counted=self.counted[chosen],
        )

    @property
    def mean(self) -> float:
        """Mean 3-D error, m."""
        return float(np.linalg.norm(self.error, axis=1).mean())

    @property
    def covariance(self) -> Array:
        """(n, 3, 3) m^2 of the error."""
        return self.inflation * (self.learned + self.white) + self.instrument

    @property
    def coverage(self) -> float:
        """Share of rows in their 95 % region."""
        solved = np.linalg.solve(self.covariance, self.error[:, :, None])[:, :, 0]
        squared = (self.error * solved).sum(axis=1)
        return float((squared <= chi_point(LEVEL, 3) ** 2).mean())


def predict_held_out(
    design: Design,
    sums: Sequence[Sums],
    fit: Weights,
    uncarried: Array,
    repeatability: float,
    *,
    kept: Sequence[WhitenedRows] = (),
    shift: float = 0.0,
    begin: Sequence[LearnedScales] | None = None,
) -> HeldOutRows:
    """Returns every row predicted from the other blocks, with a factor of one.

    Args:
        design: The linear model.
        sums: Of all rows.
        fit: At the learned scales.
        uncarried: (rows,) m^2, variance of the smooth residual that its centres do not carry.
        repeatability: m, sd per axis, part of the rows' stated covariance.
        kept: All rows, from :meth:`Design.keep_rows`.
        shift: m, sd per axis of a shift between blocks caused by the time between them alone.
        begin: The fits without each block from which learning begins, initial scales if there are
            none; None: it begins at ``fit``.
    """
    count = len(design.weights)
    fold = label_blocks(count)
    error, learned, white, instrument = (
        np.zeros((count, 3)),
        *np.zeros((3, count, 3, 3)),
    )
    fits: list[LearnedScales] = []
    for k in np.unique(fold):
        chosen = fold == k
        others = sums_without(design, sums, chosen, kept)
        if begin is None:
            weights = find_scales(others, fit.groups, fit.noise, steps=STEPS)
        else:
            weights = learn_without(design, others, begin[k] if begin else None)
            fits.append(list_scales(others, weights, design.physical))
        for item in design.rows(chosen, kept):
            lower, columns = item.lower[:, :3, :3], item.columns[:, :3]
            back = np.swapaxes(lower, 1, 2)
            off = item.values[:, :3] - columns @ weights.mean
            known = item.instrument[:, :3, :3] - repeatability**2 * np.eye(3)
            error[item.rows] = (lower @ off[:, :, None])[:, :, 0]
            learned[item.rows] = lower @ weights.spread(columns) @ back
            white[item.rows] = weights.noise[0] * lower @ back - known
            instrument[item.rows] = known + shift**2 * np.eye(3)
    learned += uncarried[:, None, None] * np.eye(3)
    return HeldOutRows(
        error=error,
        learned=learned,
        white=white,
        instrument=instrument,
        counted=design.weights > 0.0,
        fits=tuple(fits),
    )


def learn_without(
    design: Design, others: Sequence[Sums], begin: LearnedScales | None = None
) -> Weights:
    """Returns the weights that the sums of some rows give, all scales learned from the start.

    Args:
        design: Of all rows.
        others: Sums of the rows that are not left out.
        begin: Where learning begins; initial scales if None.
    """
    groups = design.groups({} if begin is None else dict(begin.scales))
    noise = np.ones(len(others)) if begin is None else begin.noise
    return find_scales(others, groups, noise, steps=REFIT_STEPS, least_gain=LEAST_GAIN)


def list_scales(sums: Sequence[Sums], fit: Weights, physical: int) -> LearnedScales:
    """Returns scales, noise and freedom of a fit; arguments as of :func:`count_freedom`."""
    return LearnedScales(
        scales=fit.scales(),
        noise=fit.noise,
        freedom=count_freedom(sums, fit, physical),
    )


def average_held_out(members: Sequence[HeldOutRows], share: Array) -> HeldOutRows:
    """Returns the average's prediction of the rows that all models were held out of.

    Args:
        members: Of the same rows.
        share: (k,) weights; they sum to one.
    """
    errors = np.array([member.error for member in members])
    error = np.tensordot(share, errors, 1)
    apart = np.sqrt(share)[:, None, None] * (errors - error)
    learned = sum(a * m.learned for a, m in zip(share, members, strict=True))
    white = sum(a * m.white for a, m in zip(share, members, strict=True))
    return HeldOutRows(
        error=error,
        learned=learned + np.einsum("kni,knj->nij", apart, apart),
        white=np.asarray(white),
        instrument=members[0].instrument,
        counted=np.logical_or.reduce([member.counted for member in members]),
        freedom=float(share @ [member.freedom for member in members]),
    )


def label_blocks(rows: int) -> IntArray:
    """Returns the number (rows,) of the contiguous block that each row is held out with."""
    blocks = min(BLOCKS, max(2, rows // 6))
    return np.asarray(np.arange(rows) * blocks // rows)


def sums_without(
    design: Design,
    sums: Sequence[Sums],
    left_out: BoolArray,
    kept: Sequence[WhitenedRows] = (),
) -> list[Sums]:
    """Returns the sums of the rows that are not left out.

    Args:
        design: The linear model.
        sums: Of all rows.
        left_out: Mask over the measurement set.
        kept: All rows, from :meth:`Design.keep_rows`.
    """
    if all(s.few for s in sums):
        return design.sums(~left_out, kept)
    return [a.without(b) for a, b in zip(sums, design.sums(left_out, kept), strict=True)]


def count_freedom(sums: Sequence[Sums], fit: Weights, physical: int) -> float:
    """Returns the degrees of freedom that the width of a fit rests on.

    The rows less a third of the physical parameters the data determine; or the numbers measured
    beyond all that weights, and scales the data moved, took, where these are fewer.

    Args:
        sums: Of all rows.
        fit: At the learned scales.
        physical: Number of active physical parameters; they come first.
    """
    measured = float(sum(s.count for s in sums))
    arm = sum(
        seen
        for group, seen in zip(fit.groups, fit.determined.tolist(), strict=True)
        if group.columns[0] < physical
    )
    moved = sum(
        group.learned and seen > HALF
        for group, seen in zip(fit.groups, fit.determined.tolist(), strict=True)
    )
    return float(min((measured - arm) / 3.0, measured - fit.determined.sum() - moved))


def widen(found: HeldOutRows, *, numbers_per_row: float = 1.0) -> HeldOutRows:
    """Returns the same with the factor on the covariance; see the top of this file.

    That all rows lie inside makes nothing narrower before there are :data:`MANY` of them, of twenty
    that is expected; only a variance below the stated one does, as where an arm repeats better
    than its stated repeatability.

    Args:
        found: From :func:`predict_held_out`, with its freedom, or :func:`average_held_out`.
        numbers_per_row: Numbers of a row that count as one against the prior.
    """
    rows = len(found.error)
    share = rows / (rows + QUANTILE_ROWS)
    law = float(np.log(student_factor(max(found.freedom, LEAST_FREEDOM))))
    matched = _match_variance(found, PRIOR_NUMBERS * numbers_per_row)
    variance, quantile = np.log([matched, match_quantile(found)]).tolist()
    if rows < MANY:
        quantile = max(quantile, min(variance, 0.0))
    factor = float(np.exp((1.0 - share) * (variance + law) + share * quantile))
    return replace(found, inflation=min(factor, LARGEST))


def _match_variance(found: HeldOutRows, prior: float) -> float:
    """The factor at which the misfit of the rows has the variance stated, one a priori."""
    counted = found.counted
    if not counted.any():
        return 1.0
    error, own = found.error[counted], (found.learned + found.white)[counted]
    instrument, cut = found.instrument[counted], chi_point(CUT, 3) ** 2
    low, high = np.log(SMALLEST), np.log(LARGEST)
    for _ in range(30):
        middle = 0.5 * (low + high)
        factor = float(np.exp(middle))
        covariance = factor * own + instrument
        solved = np.linalg.solve(covariance, error[:, :, None])
        squared = (error * solved[:, :, 0]).sum(axis=1)
        # A row counts no more than one at the point beyond which rows are screened.
        capped = np.minimum(1.0, cut / np.maximum(squared, 1e-300))
        pull = (solved[:, :, 0] * (factor * own @ solved)[:, :, 0]).sum(axis=1) * capped
        stated = np.trace(np.linalg.solve(covariance, factor * own), axis1=1, axis2=2)
        slope = float((pull - stated).sum()) + prior * (1.0 / factor - 1.0)
        low, high = (middle, high) if slope > 0.0 else (low, middle)
    return float(np.exp(high))


def match_quantile(found: HeldOutRows) -> float:
    """Returns the factor with 95 % of the rows in their region, by bisection in its logarithm."""
    low, high = np.log(SMALLEST), np.log(LARGEST)
    for _ in range(30):
        middle = 0.5 * (low + high)
        if replace(found, inflation=float(np.exp(middle))).coverage < LEVEL:
            low = middle
        else:
            high = middle
    return float(np.exp(high))
