"""The linear model around an estimate.

Every column follows from the Jacobian of the rows: drive angles act like ``theta``, the tool point
like a shift of the base. So points and full poses, in base or in a tracker frame, with one
reflector or several, need no special case.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import StandardTerms
from robotrue.calibration.evidence import PriorGroup, Sums, SumsBuilder
from robotrue.calibration.observations import (
    CHANNELS,
    PointObservation,
    linear_rows,
)
from robotrue.calibration.parameters import ParameterLayout, State, difference
from robotrue.calibration.settings import LEARNED, Prior
from robotrue.calibration.terms.smooth import SmoothBasis, SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.robust import Loss, consistency

MOST_NUMBERS: Final = 20_000
"""Numbers beyond which the rows are not kept in memory side by side."""


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

    def part(self, chosen: BoolArray) -> WhitenedRows:
        """Returns the rows of a mask over the measurement set."""
        mine = chosen[self.rows]
        return WhitenedRows(
            columns=self.columns[mine],
            values=self.values[mine],
            lower=self.lower[mine],
            instrument=self.instrument[mine],
            rows=self.rows[mine],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Design(StandardTerms):
    """Columns of the linear model, and the point of linearisation.

    Attributes:
        observations: Points and poses.
        layout: Of the physical parameters.
        prior: Of the physical parameters.
        state: Point of linearisation.
        noise: (2,) white variance of lengths (m^2) and angles (rad^2).
        weights: (rows of the set,) robust weight.
        loss: The robust rule that made them.
        terms: Beyond the physical parameters: ripple, backlash, smooth residual, then others.
        values: (k,) their parameters where terms that are not linear are linearised.
        active: (p,) columns in use, free physical parameters first; the others are zero.
        few: The rows are too few to determine the scale of each band of ripple.
    """

    observations: tuple[PointObservation, ...]
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

    @property
    def physical(self) -> int:
        """Number of active physical parameters; they come first."""
        return int(self.active[: len(self.free)].sum())

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
    def offset(self) -> Array:
        """Physical parameters of the state, counted from the prior mean."""
        return difference(self.layout, self.state, self.prior.centre)[self.free]

    def rows(
        self, chosen: BoolArray | None = None, kept: Sequence[WhitenedRows] = ()
    ) -> Iterator[WhitenedRows]:
        """Yields the rows (of a mask over the measurement set, or all), some hundred at a time.

        Args:
            chosen: Mask; all if None.
            kept: From :meth:`keep_rows`.
        """
        if kept:
            yield from kept if chosen is None else (item.part(chosen) for item in kept)
            return
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
                columns=inverse @ np.take(item.columns, used, axis=2),  # faster than an index
                values=(inverse @ item.values[:, :, None])[:, :, 0],
                lower=np.asarray(lower, dtype=np.float64),
                instrument=item.covariance,
                rows=item.rows,
            )

    def keep_rows(self) -> tuple[WhitenedRows, ...]:
        """Returns all rows, to be used again; none where they are too many for the memory."""
        numbers = sum(o.covariance.shape[1] * len(o.rows) for o in self.observations)
        return tuple(self.rows()) if numbers <= MOST_NUMBERS else ()

    def with_centres(self, basis: SmoothBasis) -> Design:
        """Returns the design with centres of a smooth residual, where it had none."""
        smooth, size = SmoothResidual(basis=basis), 3 * len(basis.centres)
        first = self.place("smooth").start
        return replace(
            self,
            terms=tuple(smooth if term.name == smooth.name else term for term in self.terms),
            values=np.insert(self.values, np.full(size, first - len(self.free)), 0.0),
            active=np.insert(self.active, np.full(size, first), True),
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
        """Returns the white variance (2,) from factors (c,) on that of the whitening."""
        known, noise = self.instrument()[: len(tau)], self.noise.copy()
        noise[: len(tau)] = tau * (known + noise[: len(tau)]) - known
        return noise

    def sums(
        self, chosen: BoolArray | None = None, kept: Sequence[WhitenedRows] = ()
    ) -> list[Sums]:
        """Returns the sums of lengths and, where orientations were measured, of angles.

        Args:
            chosen: Mask over the measurement set; all rows if None.
            kept: From :meth:`keep_rows`.
        """
        size = int(self.active.sum())
        posed = any(o.rotation is not None for o in self.observations)
        builders = [SumsBuilder(size) for _ in range(CHANNELS if posed else 1)]
        for item in self.rows(chosen, kept):
            numbers = item.values.shape[1]
            weight = self.weights[item.rows]
            root = np.sqrt(weight)[:, None]
            counted = consistency(numbers, self.loss) * 3.0 * float((weight > 0).sum())
            for channel in range(numbers // 3):
                place = slice(3 * channel, 3 * channel + 3)
                columns = (item.columns[:, place] * root[:, :, None]).reshape(-1, size)
                values = (item.values[:, place] * root).reshape(-1)
                builders[channel].add(columns, values, counted)
        stated = self.instrument(chosen)
        out = []
        for channel, builder in enumerate(builders):
            least = float(stated[channel] / (stated[channel] + self.noise[channel]))
            out.append(replace(builder.sums(), least=least) if self.few else builder.sums())
        return out

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
