"""The linear model around an estimate, and how far off, and how sure, it is on rows it did not see.

Every column comes out of the rows' own Jacobian: drive angles act where ``theta`` acts, the tool
point where a shift of the base acts. So points and full poses, in base or in a tracker frame, with
one reflector or several, need no case of their own.

Within the training rows alone: the rows are cut into contiguous blocks in the order they were
measured; the scales, the noise and the weights are learned anew without each block, which is then
predicted. The covariance gets the factor that makes 95 % of the held-out rows fall into their 95 %
region. With few rows that factor is a matter of chance; it is then drawn towards the one of
Student's law for a variance known from as many numbers as are left.
What stays common to all blocks: linearisation, robust weights, and the lengths of the smooth part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.evidence import PriorGroup, Sums, Weights, learn, spread, sums_of
from robotrue.calibration.observations import (
    CHANNELS,
    PoseObservation,
    PositionObservation,
    linear_rows,
)
from robotrue.calibration.parameters import ParameterLayout, State, difference
from robotrue.calibration.priors import LEARNED, Prior
from robotrue.calibration.robust import LEVEL, Loss, chi_point, consistency, student_factor
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.core.arrays import Array, BoolArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class WhitenedRows:
    """Some rows, whitened by their noise: n rows of m numbers, p columns.

    Attributes:
        columns: (n, m, p).
        values: (n, m).
        lower: (n, m, m) L with L L' the noise covariance; L takes whitened numbers back.
        instrument: (n, m, m) covariance of instrument and repeatability.
        rows: (n,) rows of the measurement set.
    """

    columns: Array
    values: Array
    lower: Array
    instrument: Array
    rows: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """What the columns are, and where they are taken.

    Attributes:
        observations: Points and poses.
        layout: Of the physical parameters.
        prior: Of the physical parameters.
        state: Where everything is linearised.
        noise: (2,) white variance of lengths (m^2) and angles (rad^2).
        weights: (rows of the set,) robust weight.
        loss: The robust rule that made them.
        terms: Beyond the physical parameters: ripple, backlash, smooth residual, then others.
        values: (k,) their parameters where terms that are not linear are linearised.
        active: (p,) columns in use, free physical parameters first; the others stand at zero.
        few: The rows are too few to say the scale of each band of ripple.
    """

    observations: tuple[PositionObservation | PoseObservation, ...]
    layout: ParameterLayout
    prior: Prior
    state: State
    noise: Array
    weights: Array
    loss: Loss
    terms: tuple[Term, ...]
    values: Array
    active: BoolArray
    few: bool = False

    @property
    def free(self) -> IntArray:
        """Physical parameters that are estimated."""
        return np.flatnonzero(self.prior.free)

    def place(self, name: str) -> slice:
        """Returns the columns of a term.

        Raises:
            KeyError: No such term.
        """
        start = len(self.free)
        for term in self.terms:
            if term.name == name:
                return slice(start, start + term.size)
            start += term.size
        raise KeyError(name)

    @property
    def ripple(self) -> Ripple:
        """The term of that name."""
        return next(term for term in self.terms if isinstance(term, Ripple))

    @property
    def smooth(self) -> SmoothResidual:
        """The term of that name."""
        return next(term for term in self.terms if isinstance(term, SmoothResidual))

    @property
    def offset(self) -> Array:
        """Physical parameters of the state, counted from the prior mean."""
        return difference(self.layout, self.state, self.prior.centre)[self.free]

    def rows(self, chosen: BoolArray | None = None) -> Iterator[WhitenedRows]:
        """Yields the rows (of a mask over the measurement set, or all), some hundred at a time."""
        about = np.zeros(self.layout.size)
        about[self.free] = self.offset
        learned = self.layout.size + np.arange(len(self.values))
        used = np.concatenate([self.free, learned])[self.active]
        for item in linear_rows(
            self.observations, self.layout, self.state, about, self.terms, self.values, chosen
        ):
            lower = np.linalg.cholesky(item.total(self.noise))
            inverse = np.linalg.inv(lower)
            yield WhitenedRows(
                columns=inverse @ item.columns[:, :, used],
                values=(inverse @ item.values[:, :, None])[:, :, 0],
                lower=np.asarray(lower, dtype=np.float64),
                instrument=item.covariance,
                rows=item.rows,
            )

    def instrument(self, chosen: BoolArray | None = None) -> Array:
        """Returns the mean variance (2,) per axis that rows state: m^2 of lengths, rad^2 of angles.

        Zero where there are none.
        """
        total, count = np.zeros(CHANNELS), np.zeros(CHANNELS)
        for observation in self.observations:
            stated = np.diagonal(observation.covariance, axis1=1, axis2=2)
            if chosen is not None:
                stated = stated[chosen[observation.rows]]
            for channel in range(stated.shape[1] // 3):
                mine = stated[:, 3 * channel : 3 * channel + 3]
                total[channel] += mine.sum()
                count[channel] += mine.size
        return np.asarray(total / np.maximum(count, 1.0))

    def white_noise(self, tau: Array) -> Array:
        """Returns the white variance (2,) behind factors (c,) on that of the whitening."""
        known, noise = self.instrument()[: len(tau)], self.noise.copy()
        noise[: len(tau)] = tau * (known + noise[: len(tau)]) - known
        return noise

    def sums(self, chosen: BoolArray | None = None) -> list[Sums]:
        """Returns the sums of lengths and, where orientations were measured, of angles."""
        size = int(self.active.sum())
        posed = any(isinstance(o, PoseObservation) for o in self.observations)
        stated = self.instrument(chosen)
        out = []
        for channel in range(CHANNELS if posed else 1):
            sums = sums_of(self._blocks(channel, chosen), size)
            least = float(stated[channel] / (stated[channel] + self.noise[channel]))
            out.append(replace(sums, least=least) if self.few else sums)
        return out

    def _blocks(
        self, channel: int, chosen: BoolArray | None
    ) -> Iterator[tuple[Array, Array, float]]:
        for item in self.rows(chosen):
            place = slice(3 * channel, 3 * channel + 3)
            if item.values.shape[1] <= 3 * channel:
                continue
            weight = self.weights[item.rows]
            root = np.sqrt(weight)[:, None]
            counted = consistency(item.values.shape[1], self.loss) * 3.0 * float((weight > 0).sum())
            columns = (item.columns[:, place] * root[:, :, None]).reshape(-1, item.columns.shape[2])
            yield columns, (item.values[:, place] * root).reshape(-1), counted

    def groups(self, scales: dict[str, float]) -> list[PriorGroup]:
        """Returns the groups over the active columns, with scales by name where known."""
        found = self._physical_groups()
        for term in self.terms:
            start = self.place(term.name).start
            found += [
                replace(group, columns=start + group.columns) for group in term.groups(few=self.few)
            ]
        position = np.cumsum(self.active) - 1
        out = []
        for group in found:
            kept = self.active[group.columns]
            if kept.any():
                out.append(
                    PriorGroup(
                        name=group.name,
                        columns=position[group.columns[kept]],
                        sd=scales.get(group.name, group.sd),
                        rest=group.rest,
                        shape=group.unit[kept],
                        hold=group.hold,
                    )
                )
        return out

    def _physical_groups(self) -> list[PriorGroup]:
        sd, number = self.prior.sd[self.free], self.prior.group[self.free]
        out = []
        for k in np.unique(number):
            columns = np.flatnonzero(number == k)
            if k < 0:
                out.append(PriorGroup(name="frames", columns=columns, sd=1.0, shape=sd[columns]))
            else:
                name = LEARNED[int(k)]
                out.append(
                    PriorGroup(name=name, columns=columns, sd=1.0, rest=1.0, shape=sd[columns])
                )
        return out


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
class HeldOutRows:
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
    inflation: float

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
) -> HeldOutRows:
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
    return _cover_blocks(
        HeldOutRows(error=error, learned=learned, white=white, instrument=instrument, inflation=1.0)
    )


def temper_factor(found: HeldOutRows, freedom: float) -> HeldOutRows:
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


def _cover_blocks(found: HeldOutRows) -> HeldOutRows:
    """Returns the factor by bisection in its logarithm; coverage grows with it."""
    low, high = -np.log(4.0), np.log(LARGEST)
    for _ in range(30):
        middle = 0.5 * (low + high)
        if replace(found, inflation=float(np.exp(middle))).coverage < LEVEL:
            low = middle
        else:
            high = middle
    return replace(found, inflation=float(np.exp(high)))
