"""The linear model around an estimate: columns of physics, ripple, backlash and smooth residual.

Every column comes out of the rows' own Jacobian: drive angles act where ``theta`` acts, the smooth
residual where a shift of the base acts. So points and full poses, in base or in a tracker frame,
with one reflector or several, need no case of their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.evidence import Group, Sums, sums_of
from robotrue.calibration.observations import (
    CHANNELS,
    PoseObservation,
    PositionObservation,
)
from robotrue.calibration.parameters import Layout, State, difference
from robotrue.calibration.priors import LEARNED, Prior
from robotrue.calibration.ripple import harmonics, ripple_columns, ripple_groups
from robotrue.calibration.robust import Loss, consistency
from robotrue.calibration.smooth import SmoothBasis
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.robot.model import parameter_slice

ROWS: Final = 512
"""Poses worked on at a time; bounds the memory."""
BACKLASH_START: Final = 1e-5
BACKLASH_REST: Final = 1e-7
"""rad, half the backlash of a drive: where learning starts and where it falls back to."""
SMOOTH_REST: Final = 1e-7
"""m, amplitude of a smooth residual the data do not ask for."""

Seen: TypeAlias = PositionObservation | PoseObservation


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
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
        approach: (rows of the set, dof) sign of the last motion.
        layout: Of the physical parameters.
        prior: Of the physical parameters.
        state: Where everything is linearised.
        noise: (2,) white variance of lengths (m^2) and angles (rad^2).
        weights: (rows of the set,) robust weight.
        loss: The robust rule that made them.
        count: Highest harmonic.
        basis: Centres of the smooth residual, if any.
        active: (p,) columns in use; the others stand at zero.
        few: The rows are too few to say the scale of each band of ripple.
    """

    observations: tuple[Seen, ...]
    approach: Array
    layout: Layout
    prior: Prior
    state: State
    noise: Array
    weights: Array
    loss: Loss
    count: int
    basis: SmoothBasis | None
    active: BoolArray
    few: bool = False

    @property
    def free(self) -> IntArray:
        """Physical parameters that are estimated."""
        return np.flatnonzero(self.prior.free)

    @property
    def starts(self) -> tuple[int, int, int, int]:
        """First column of ripple, backlash and smooth residual, and the number of columns."""
        ripple = len(self.free)
        backlash = ripple + 2 * self.layout.dof * self.count
        smooth = backlash + self.layout.dof
        centres = 0 if self.basis is None else len(self.basis.centres)
        return ripple, backlash, smooth, smooth + 3 * centres

    @property
    def offset(self) -> Array:
        """Physical parameters of the state, counted from the prior mean."""
        return difference(self.layout, self.state, self.prior.centre)[self.free]

    def rows(self, chosen: BoolArray | None = None) -> Iterator[Rows]:
        """Yields the rows (of a mask over the measurement set, or all), some hundred at a time."""
        for observation in self.observations:
            mine = np.arange(len(observation.rows))
            if chosen is not None:
                mine = mine[chosen[observation.rows]]
            for start in range(0, len(mine), ROWS):
                yield self._rows(observation, mine[start : start + ROWS])

    def _rows(self, observation: Seen, part: IntArray) -> Rows:
        item = observation.linearise(self.layout, self.state, part)  # type: ignore[arg-type]
        jacobian, joints = item.jacobian, observation.visits.joints[part]
        robot, dof = self.state.robot, self.layout.dof
        drive = jacobian[:, :, parameter_slice(dof, "theta")] @ robot.joint_map
        rows = observation.rows[part]
        pieces = [
            jacobian[:, :, self.free],
            ripple_columns(drive, joints, harmonics(self.count)),
            drive * self.approach[rows][:, None, :],
        ]
        if self.basis is not None:
            shift = jacobian[:, :, parameter_slice(dof, "base")][:, :, :3]
            pieces.append(smooth_columns(shift, self.basis.columns(joints)))
        columns = np.concatenate(
            [p[:, :, a] for p, a in zip(pieces, self._split(), strict=True)], 2
        )
        values = item.residual + jacobian[:, :, self.free] @ self.offset
        size = item.residual.shape[1]
        lower = np.linalg.cholesky(item.covariance + (self.noise @ item.white) * np.eye(size))
        inverse = np.linalg.inv(lower)
        return Rows(
            columns=inverse @ columns,
            values=(inverse @ values[:, :, None])[:, :, 0],
            lower=np.asarray(lower, dtype=np.float64),
            instrument=item.covariance,
            rows=rows,
        )

    def _split(self) -> list[IntArray]:
        ripple, backlash, smooth, end = self.starts
        edges = [0, ripple, backlash, smooth] + ([end] if self.basis is not None else [])
        return [np.flatnonzero(self.active[a:b]) for a, b in pairwise(edges)]

    def sums(self, chosen: BoolArray | None = None) -> list[Sums]:
        """Returns the sums of lengths and, where orientations were measured, of angles."""
        size = int(self.active.sum())
        posed = any(isinstance(o, PoseObservation) for o in self.observations)
        out = []
        for channel in range(CHANNELS if posed else 1):
            found = sums_of(self._blocks(channel, chosen), size)
            out.append(replace(found, least=self._stated(channel, chosen)) if self.few else found)
        return out

    def _stated(self, channel: int, chosen: BoolArray | None) -> float:
        """Mean share of the whitening's variance that instrument and repeatability state."""
        place = slice(3 * channel, 3 * channel + 3)
        stated = total = 0.0
        for item in self.rows(chosen):
            if item.values.shape[1] > 3 * channel:
                stated += float(np.trace(item.instrument[:, place, place], axis1=1, axis2=2).sum())
                total += float((item.lower[:, place] ** 2).sum())
        return stated / total if total else 0.0

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

    def groups(self, scales: dict[str, float]) -> list[Group]:
        """Returns the groups over the active columns, with scales by name where known."""
        ripple, backlash, smooth, end = self.starts
        dof = self.layout.dof
        found = [
            *self._physical_groups(),
            *ripple_groups(dof, self.count, ripple, few=self.few),
            Group(
                name="backlash",
                columns=np.arange(backlash, smooth),
                sd=BACKLASH_START,
                rest=BACKLASH_REST,
            ),
        ]
        if end > smooth:
            found.append(
                Group(
                    name="smooth",
                    columns=np.arange(smooth, end),
                    sd=1e-4,
                    rest=SMOOTH_REST,
                )
            )
        position = np.cumsum(self.active) - 1
        out = []
        for group in found:
            kept = self.active[group.columns]
            if kept.any():
                out.append(
                    Group(
                        name=group.name,
                        columns=position[group.columns[kept]],
                        sd=scales.get(group.name, group.sd),
                        rest=group.rest,
                        shape=group.unit[kept],
                        hold=group.hold,
                    )
                )
        return out

    def _physical_groups(self) -> list[Group]:
        sd, number = self.prior.sd[self.free], self.prior.group[self.free]
        out = []
        for k in np.unique(number):
            columns = np.flatnonzero(number == k)
            if k < 0:
                out.append(Group(name="frames", columns=columns, sd=1.0, shape=sd[columns]))
            else:
                name = (*LEARNED, "compliance")[int(k)]
                out.append(Group(name=name, columns=columns, sd=1.0, rest=1.0, shape=sd[columns]))
        return out


def smooth_columns(shift: Array, columns: Array) -> Array:
    """Returns (n, m, 3 k) from d(row)/d(shift of base) (n, m, 3) and (n, k) columns per axis."""
    n, m, _ = shift.shape
    return (columns[:, None, :, None] * shift[:, :, None, :]).reshape(n, m, -1)
