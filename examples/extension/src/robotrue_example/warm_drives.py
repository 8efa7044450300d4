"""Error term of an external package: the drives turn as the hall warms up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.terms.term import ArmPostures, Effect, MeanTables, Term
from robotrue.core.arrays import Array
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel, parameter_slice

USUAL = 303.15
"""K, usual temperature of programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmDrives(Term):
    """dq_i = v_i (T - T_0): the joints turn with the temperature of the hall."""

    name: ClassVar[str] = "warm-drives"
    dof: int
    reference: float

    @property
    def parameters(self) -> tuple[str, ...]:
        """``warm1 ..``."""
        return tuple(f"warm{joint + 1}" for joint in range(self.dof))

    @property
    def unit(self) -> str:
        """Unit of every parameter."""
        return "rad/K"

    def _rise(self, at: ArmPostures) -> Array:
        stated = at.conditions.temperature.mean(axis=1)
        return np.where(np.isnan(stated), USUAL, stated) - self.reference

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(coefficients), shape (n, m, dof)."""
        return by.drive * self._rise(at)[:, None, None]

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the drives."""
        return Effect(drive_shift=self._rise(at)[:, None] * values)

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns the single prior group."""
        return [PriorGroup(name=self.name, columns=np.arange(self.dof), sd=1e-5, rest=1e-8)]

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables:
        """Returns the tables at the usual temperature."""
        errors = np.array(tables.robot.errors)
        turned = tables.robot.joint_map @ values * (USUAL - self.reference)
        errors[parameter_slice(self.dof, "theta")] += turned
        return replace(tables, robot=tables.robot.with_errors(errors))

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> WarmDrives | None:
        """Returns the term if all rows have a temperature and it varies by 2 K or more."""
        known = measurements.temperature[np.isfinite(measurements.temperature)]
        if len(known) < len(measurements) or np.ptp(known) < 2.0:
            return None
        return cls(dof=robot.dof, reference=float(known.mean()))

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns the coefficients."""
        return {"coefficients": values}

    def document(self) -> Mapping[str, Any]:
        """Returns the reference temperature, at which the drive shift is zero."""
        return {"reference_K": self.reference}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, Any], arrays: Mapping[str, Array]
    ) -> tuple[WarmDrives, Array]:
        """Returns the term and its coefficients."""
        return cls(dof=robot.dof, reference=document["reference_K"]), arrays["coefficients"]
