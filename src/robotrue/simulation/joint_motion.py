"""How a simulated controller moves its joints in time, and its places on the grid of its cycles.

Where the arm goes depends on time alone, and arrays of one element cost as much as arrays of sixty:
many cycles are computed at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Protocol

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.rotations import abc_from_matrix, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
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

    def __post_init__(self) -> None:
        """Checks the values."""
        self._check_columns(dof=self.robot.dof)
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


_AHEAD: Final = 64
"""Cycles: half a millisecond of work four times a second."""
Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Place:
    """Where the arm is in a cycle, in the units of controllers.

    Attributes:
        joints_deg: As displayed.
        pose_mm_deg: X, Y, Z, A, B, C of the tool in base; None where it is not known.
        quat_wxyz: Attitude of the tool in base; that of no turn where it is not known.
    """

    joints_deg: Six
    pose_mm_deg: Six | None
    quat_wxyz: tuple[float, ...]


def six(numbers: list[float]) -> Six:
    """Returns a list of six as a tuple."""
    a, b, c, d, e, f = numbers
    return a, b, c, d, e, f


class MotionGrid:
    """The places of a motion on the grid of a controller's cycles.

    Args:
        motion: Of an arm of six joints.
        cycle: s.
    """

    def __init__(self, motion: ArmMotion, cycle: float) -> None:
        self._motion, self._cycle = motion, cycle
        self._first, self._places = 0, list[Place]()

    def at(self, number: int) -> Place:
        """Returns the place at a cycle, counted from zero."""
        row = number - self._first
        if not 0 <= row < len(self._places):
            self._first, row = number, 0
            times = np.arange(number, number + _AHEAD, dtype=np.float64) * self._cycle
            self._places = _places(self._motion, times)
        return self._places[row]


def _places(motion: ArmMotion, times: Array) -> list[Place]:
    joints, poses = motion.along(times)
    known: BoolArray = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    turns = np.where(known[:, None, None], poses, np.eye(4))[:, :3, :3]
    printed = np.concatenate([poses[:, :3, 3] / MM, abc_from_matrix(turns) / DEG], axis=1)
    columns = (joints / DEG, printed, quat_wxyz_from_matrix(turns), known)
    return [
        Place(six(a), six(b) if there else None, tuple(q))
        for a, b, q, there in zip(*(column.tolist() for column in columns), strict=True)
    ]
