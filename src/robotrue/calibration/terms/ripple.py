"""Joint ripple: errors of the drive angle, mapped through the arm's Jacobian.

    dq_i(q_i) = sum_N A_iN sin(N q_i) + B_iN cos(N q_i)

Gears, bearings and encoders err periodically in the joint angle. The error at the tool is the drive
error times dx/dq_i, so the coefficients are linear, and those learned in one part of the workspace
are valid in every other. N runs over whole cycles per revolution: on the range of a joint they form
any curve up to their highest frequency. Each joint and band of N has a separate variance, learned
from the data (:mod:`robotrue.calibration.evidence`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Final, Self

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.terms.term import ArmPostures, Carry, Effect, MeanTables, Term
from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel

BANDS: Final = (1, 4, 8, 14, 20, 32, 45, 65, 97, 120, 137, 193, 251, 265)
"""First N of each band; narrow where drives err most, around the encoders' 128 and 256."""
START: Final = 1e-5
START_FAST: Final = 3e-6
FAST: Final = 45
"""rad, sd of one coefficient from which learning starts, below and from ``FAST`` cycles."""
REST: Final = 1e-7
"""rad, sd of a band without support by the data."""
LAW: Final = 5e-5
"""rad, sd of a coefficient at one cycle per revolution where rows are few: an eccentric encoder or
gear wheel errs by 10 arc seconds. At N cycles it is an N-th of that."""
HOLD: Final = 0.5
"""Of each band to that law, where rows are few: a factor of e in the scale is one sigma."""
LADDER: Final = (16, 64, 136, 264)
"""Highest N that is tried, one after the other, while the evidence grows."""
POSES_PER_HARMONIC: Final = 3
"""Required poses per harmonic: half the numbers the coefficients of six joints would need."""
HELD_HARMONICS: Final = 64
"""Highest harmonic whatever the rows, from ``HELD_ROWS``: the law they are held to decays."""
HELD_ROWS: Final = 24
WIDE_ROWS: Final = 4000
"""Rows up to which the last rung is tried; it costs eight times the rung before."""


def harmonics(count: int) -> Array:
    """Returns 1, 2, ..., ``count`` cycles per revolution."""
    return np.arange(1.0, count + 1.0)


def highest_harmonic(rows: int, *, few: bool, most: int = LADDER[-1]) -> int:
    """Returns the highest rung of the ladder that a number of rows can carry, at most ``most``."""
    highest = most if rows <= WIDE_ROWS else min(most, LADDER[-2])
    carried = rows / POSES_PER_HARMONIC
    if rows >= HELD_ROWS and few:
        carried = max(carried, HELD_HARMONICS)
    return max((h for h in LADDER if h <= min(highest, carried)), default=LADDER[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ripple(Term):
    """Ripple of all joints; parameters joint by joint, N by N, sine before cosine.

    Attributes:
        dof: Number of joints.
        cycles: (h,) N, cycles per revolution.
    """

    name: ClassVar[str] = "ripple"
    carry: ClassVar[Carry] = "waves"
    export_name: ClassVar[str] = "ripple"
    dof: int
    cycles: Array

    def __post_init__(self) -> None:
        """Freezes."""
        object.__setattr__(self, "cycles", frozen(self.cycles, (None,), "cycles"))

    @property
    def parameters(self) -> tuple[str, ...]:
        """``ripple1_sin1, ripple1_cos1 ...``: joint, wave, N."""
        return tuple(
            f"ripple{joint + 1}_{wave}{int(n)}"
            for joint in range(self.dof)
            for n in self.cycles
            for wave in ("sin", "cos")
        )

    @property
    def size(self) -> int:
        """2 dof h."""
        return 2 * self.dof * len(self.cycles)

    @property
    def unit(self) -> str:
        """Unit of every parameter."""
        return "rad"

    @property
    def order(self) -> Array:
        """(k,) N of every parameter."""
        return np.tile(np.repeat(self.cycles, 2), self.dof)

    def amplitudes(self, values: Array) -> tuple[Array, Array]:
        """Returns sine and cosine amplitudes (dof, h) rad of parameters (k,)."""
        waves = values.reshape(self.dof, len(self.cycles), 2)
        return waves[:, :, 0], waves[:, :, 1]

    def with_cycles(self, count: int) -> tuple[Ripple, IntArray]:
        """Returns ripple of N = 1 .. count, and the indices of the old parameters in it."""
        h = len(self.cycles)
        within = np.arange(2 * min(h, count))
        places = (2 * count * np.arange(self.dof)[:, None] + within).ravel()
        return Ripple(dof=self.dof, cycles=harmonics(count)), places

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(A, B), shape (n, m, k)."""
        phase = at.joints[:, :, None] * self.cycles
        waves = np.stack([np.sin(phase), np.cos(phase)], axis=-1)
        n, m, dof = by.drive.shape
        columns = by.drive[:, :, :, None] * waves.reshape(n, 1, dof, 2 * len(self.cycles))
        return np.asarray(columns.reshape(n, m, self.size), dtype=np.float64)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the drives."""
        sine, cosine = self.amplitudes(values)
        phase = at.joints[:, :, None] * self.cycles
        return Effect(drive_shift=(np.sin(phase) * sine + np.cos(phase) * cosine).sum(axis=2))

    def _bands(self) -> Iterator[tuple[int, int, int, IntArray]]:
        """Joint, first N, N after the last, and parameters (k,) of each band that has cycles."""
        for joint in range(self.dof):
            for low, high in pairwise(BANDS):
                chosen = np.flatnonzero((self.cycles >= low) & (self.cycles < high))
                if len(chosen):
                    first = 2 * (joint * len(self.cycles) + int(chosen[0]))
                    yield joint, low, high, np.arange(first, first + 2 * len(chosen))

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns one group for each joint and band.

        Where the rows are too few for the scale of each, all follow the law :data:`LAW` / N times
        one common factor.
        """
        out = []
        for joint, low, high, columns in self._bands():
            group = PriorGroup(
                name=f"ripple/{joint + 1}/{low}-{min(high - 1, len(self.cycles))}",
                columns=columns,
                sd=START if low < FAST else START_FAST,
                rest=REST,
            )
            if few:
                size, falling = LAW / low, low / self.order[columns]
                group = replace(group, sd=size, rest=size, shape=falling, hold=HOLD)
            out.append(group)
        return out

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns the mean power of each joint and band: the fixed point of its evidence."""
        power, out = values**2 + variance, np.zeros(self.size)
        for *_, columns in self._bands():
            out[columns] = max(float(power[columns].mean()), REST**2)
        return out

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables:
        """Returns the tables with this ripple."""
        sine, cosine = self.amplitudes(values)
        return replace(tables, harmonics=self.cycles, ripple_sin=sine, ripple_cos=cosine)

    @staticmethod
    def out_of_tables(tables: MeanTables) -> MeanTables:
        """Returns the tables without ripple."""
        none = np.zeros_like(tables.ripple_sin)
        return replace(tables, ripple_sin=none, ripple_cos=none)

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self:
        """Returns every harmonic that the rows can carry."""
        count = highest_harmonic(len(measurements), few=few)
        return cls(dof=robot.dof, cycles=harmonics(count))

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns cycles and amplitudes."""
        sine, cosine = self.amplitudes(values)
        return {"cycles": self.cycles, "ripple_sin": sine, "ripple_cos": cosine}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: Amplitudes that do not belong to the cycles.
        """
        term = cls(dof=robot.dof, cycles=arrays["cycles"])
        waves = [arrays["ripple_sin"], arrays["ripple_cos"]]
        if any(wave.shape != (term.dof, len(term.cycles)) for wave in waves):
            raise ArchiveError(f"ripple of {[w.shape for w in waves]}, expected (dof, cycles).")
        return term, np.stack(waves, axis=-1).reshape(term.size)
