"""A motion on the grid of a controller's cycles, computed many cycles at once.

Where the arm goes depends on time alone, and arrays of one element cost as much as arrays of sixty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.rotations import abc_from_matrix, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.simulation.joint_motion import ArmMotion

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
