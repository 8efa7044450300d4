"""How a simulated controller moves its joints in time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel


class ArmMotion(Protocol):
    """Where the arm is at each moment."""

    @property
    def duration(self) -> float:
        """s; infinite for a motion that repeats."""

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints (n, dof) rad as displayed and T_base_tool (n, 4, 4) m.

        Args:
            times: (n,) s from the begin of the motion.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Jog(Columns):
    """One joint to and fro: what clocks are aligned with.

    Attributes:
        robot: The arm.
        joints: (dof,) rad, model joints where it starts.
        axis: Which joint, from 1.
        amplitude: rad to the far end.
        period: s to the far end and back.
    """

    robot: RobotModel
    joints: Annotated[Array, Column("dof", unit="rad")]
    axis: int = 1
    amplitude: float = math.radians(5.0)
    period: float = 4.0

    def _known_sizes(self) -> dict[Any, int]:
        return {"dof": self.robot.dof}

    def _check_rules(self) -> None:
        """Checks the values."""
        if not 1 <= self.axis <= self.robot.dof or not self.period > 0.0:
            raise ConfigurationError(
                f"jog of axis {self.axis} in {self.period:g} s, expected an axis from 1 to "
                f"{self.robot.dof} and more than 0 s."
            )

    @property
    def duration(self) -> float:
        """Infinite: it repeats."""
        return math.inf

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints and poses; smooth, at rest at both ends."""
        joints = np.repeat(self.joints[None], len(times), axis=0)
        turn = 0.5 * (1.0 - np.cos(2.0 * math.pi * times / self.period))
        joints[:, self.axis - 1] += self.amplitude * turn
        return controller_axes(self.robot, joints), forward(self.robot, joints)
