"""Backlash: half the gap of each drive, with the sign of the joint's last motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.terms.term import ArmPostures, Carry, Effect, MeanTables, Term
from robotrue.core.arrays import Array
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel

START: Final = 1e-5
REST: Final = 1e-7
"""rad, half the backlash of a drive: where learning starts and where it falls back to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlash(Term):
    """Backlash of all joints: dq_i = backlash_i * approach_i.

    Attributes:
        dof: Number of joints.
    """

    name: ClassVar[str] = "backlash"
    carry: ClassVar[Carry] = "waves"
    export_name: ClassVar[str] = "backlash"
    dof: int

    @property
    def parameters(self) -> tuple[str, ...]:
        """``backlash1 ..``."""
        return tuple(f"backlash{joint + 1}" for joint in range(self.dof))

    @property
    def unit(self) -> str:
        """Unit of every parameter, per unit of approach."""
        return "rad"

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(backlash), shape (n, m, dof)."""
        return by.drive * at.approach[:, None, :]

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the drives."""
        return Effect(drive_shift=values * at.approach)

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns one group."""
        columns = np.arange(self.dof)
        return [PriorGroup(name=self.name, columns=columns, sd=START, rest=REST)]

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns the mean power of all joints; zero where it was never learned."""
        if not variance.any():
            return np.zeros(self.dof)
        power = float((values**2 + variance).mean())
        return np.full(self.dof, max(power, REST**2))

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables:
        """Returns the tables with this backlash."""
        return replace(tables, backlash=values)

    @staticmethod
    def out_of_tables(tables: MeanTables) -> MeanTables:
        """Returns the tables without backlash."""
        return replace(tables, backlash=np.zeros_like(tables.backlash))

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self | None:
        """Returns the term where the approach of some row is known."""
        return cls(dof=robot.dof) if (measurements.approach != 0.0).any() else None

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns the parameters."""
        return {"backlash": values}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: Not one number for each joint.
        """
        values = arrays["backlash"]
        if values.shape != (robot.dof,):
            raise ArchiveError(f"backlash of shape {values.shape}, expected ({robot.dof},).")
        return cls(dof=robot.dof), values
