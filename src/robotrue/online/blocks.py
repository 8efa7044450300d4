"""Consecutive samples of one stream as arrays: what sources give and estimators take.

A block of one row is a sample. How a stream is cut into blocks changes nothing but speed.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.dynamics.force import MOST

FARTHEST: Final = 100.0
"""m; no tool point is farther from its frame, on the longest rail."""
MOST_TURNS: Final = 36000.0 * DEG
"""rad; endless wrist axes count full turns, but not more than a hundred in one program."""
STRONGEST: Final = np.array([MOST] * 3 + [MOST] * 3)
"""N and N m; a wrench beyond it is counts or a flipped bit."""


class Flag(enum.IntFlag):
    """Faults and oddities of a sample; a sample with a flag in ``INVALID`` is not used."""

    NONE = 0
    NOT_FINITE = 1
    """A value was NaN or infinite; it is NaN here."""
    IMPLAUSIBLE = 2
    """A value beyond what any robot or sensor gives; it is NaN here."""
    REPEATED = 4
    """The same sequence number again: nothing new."""
    REORDERED = 8
    """Older than a packet that has come."""
    CLOCK_JUMP = 16
    """The sender's count left its grid, fell far back or leapt; or the host's clock went back."""
    SENSOR_FAULT = 32
    """The sender reports a fault."""
    SATURATED = 64
    """The sensor is beyond its range."""
    GAP = 128
    """Packets before this one are missing; the sample itself is sound."""
    LATE = 256
    """It came late, or the controller has counted an answer of ours as late."""
    INACTIVE = 512
    """The controller reports that force control or the motors are off."""

    INVALID = (
        NOT_FINITE | IMPLAUSIBLE | REPEATED | REORDERED | CLOCK_JUMP | SENSOR_FAULT | SATURATED
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleBlock(Columns):
    """Columns that samples of all streams share, in order of arrival.

    Attributes:
        controller_time: (n,) s on the sender's clock; NaN where it sends none.
        host_time: (n,) s on the receiving computer's monotonic clock.
        sequence: (n,) the sender's numbers.
        flags: (n,) :class:`Flag` values.
    """

    controller_time: Annotated[Array, Column("n", unit="s", nan=True)]
    host_time: Annotated[Array, Column("n", unit="s", nan=True)]
    sequence: Annotated[IntArray, Column("n")]
    flags: Annotated[IntArray, Column("n")]

    def __len__(self) -> int:
        return len(self.host_time)

    @property
    def valid(self) -> BoolArray:
        """(n,), whether an estimate may use each."""
        return np.asarray((self.flags & int(Flag.INVALID)) == 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointBlock(SampleBlock):
    """Joint samples.

    Attributes:
        joints: (n, dof) rad as the controller displays them.
        T_frame_tool: (n, 4, 4) m, the tool point in the controller's frame; NaN where not known.
    """

    joints: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    T_frame_tool: Annotated[Array, Column("n 4 4", nan=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBlock(SampleBlock):
    """Force samples.

    Attributes:
        wrench: (n, 6) N and N m, force first; torques NaN where only forces are measured.
        frame: Frame of its axes: "sensor", "tool", "base".
        status: (n,) status words; 0 where it sends none.
    """

    wrench: Annotated[Array, Column("n 6", nan=True)]
    frame: str
    status: Annotated[IntArray, Column("n")]


Block = JointBlock | ForceBlock


def check_wrenches(wrench: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns wrenches (n, 6) with NaN for what no sensor gives, and the flags (n,) with it.

    Torques that are all NaN were not measured: no fault.
    """
    size = np.abs(wrench)
    if (size <= STRONGEST).all():
        return wrench, flags
    measured = np.ones(wrench.shape, dtype=bool)
    measured[:, 3:] = ~np.isnan(wrench[:, 3:]).all(axis=1, keepdims=True)
    return _mark_values(wrench, size, STRONGEST, measured, flags)


def check_joints(joints: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns joints (n, dof) rad with NaN for what no arm has, and the flags (n,) with it."""
    size = np.abs(joints)
    if (size <= MOST_TURNS).all():
        return joints, flags
    return _mark_values(joints, size, MOST_TURNS, np.ones(joints.shape, dtype=bool), flags)


def check_poses(poses: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns poses (n, 4, 4) m, known whole or NaN whole, and the flags (n,) with it."""
    if (np.abs(poses) <= FARTHEST).all():  # as nearly all are; no entry of a rotation is larger
        return poses, flags
    known = ~np.isnan(poses).all(axis=(1, 2))
    finite = np.isfinite(poses).all(axis=(1, 2))
    near = finite & ~(np.abs(poses[:, :3, 3]).max(axis=1) > FARTHEST)
    flags = flags | np.where(known & ~finite, int(Flag.NOT_FINITE), 0)
    flags = flags | np.where(finite & ~near, int(Flag.IMPLAUSIBLE), 0)
    if (near | ~known).all():
        return poses, flags
    return np.where(near[:, None, None], poses, np.nan), flags


def _mark_values(
    values: Array, size: Array, most: float | Array, measured: BoolArray, flags: IntArray
) -> tuple[Array, IntArray]:
    finite = np.isfinite(values)
    strange = (measured & ~finite).any(axis=1)
    large = (measured & finite & (size > most)).any(axis=1)
    flags = flags | np.where(strange, int(Flag.NOT_FINITE), 0)
    flags = flags | np.where(large, int(Flag.IMPLAUSIBLE), 0)
    return np.where(size <= most, values, np.nan), flags
