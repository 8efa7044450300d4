"""What streams carry: joints, forces and corrections, each with its clocks and what is wrong."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
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
    """What is wrong with a sample, or odd about it; ``INVALID`` are those that forbid its use."""

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
    """The sender says that it is not well."""
    SATURATED = 64
    """The sensor is beyond its range."""
    GAP = 128
    """Packets before this one are missing; the sample itself is sound."""
    LATE = 256
    """It came late, or the controller has counted an answer of ours as late."""
    INACTIVE = 512
    """The controller says that force control or the motors are off."""

    INVALID = (
        NOT_FINITE | IMPLAUSIBLE | REPEATED | REORDERED | CLOCK_JUMP | SENSOR_FAULT | SATURATED
    )


class CorrectionMode(enum.Enum):
    """How the controller takes a correction: the setting that is most dangerous to get wrong."""

    RELATIVE = "relative"
    """Added anew in every cycle: the same value sent twice moves twice as far."""
    ABSOLUTE = "absolute"
    """Against the programmed path: the same value sent twice changes nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSample(Columns):
    """Where the robot was.

    Attributes:
        controller_time: s on the controller's clock; NaN where it sends none.
        host_time: s on the receiving computer's monotonic clock.
        joints: (n,) rad **as the controller displays them**, not in the sense of the DH table.
        T_frame_tool: (4, 4) m, the tool point in the frame the controller reports in, or all NaN
            where it was not sent or is not valid.
        sequence: The sender's own number of the packet.
        flags: What is wrong with it.
    """

    controller_time: float
    host_time: float
    joints: Annotated[Array, Column("dof", unit="rad", nan=True, inf=True)]
    T_frame_tool: Annotated[Array, Column("4 4", nan=True, inf=True)]
    sequence: int
    flags: Flag = Flag.NONE

    def _check_rules(self) -> None:
        """Checks the values: as those of a block of one row."""
        flags = np.array([int(self.flags)])
        joints, flags = check_joints(self.joints[None], flags)
        poses, flags = check_poses(self.T_frame_tool[None], flags)
        self._set_column("joints", joints[0])
        self._set_column("T_frame_tool", poses[0])
        object.__setattr__(self, "flags", Flag(int(flags[0])))

    @property
    def valid(self) -> bool:
        """Whether an estimate may use it."""
        return not self.flags & Flag.INVALID


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSample(Columns):
    """What acted on the tool.

    Attributes:
        controller_time: s on the sensor's clock; NaN where it sends none.
        host_time: s on the receiving computer's monotonic clock.
        wrench: (6,) N and N m, force first; torques all NaN where only forces are measured.
        frame: Frame of its axes, a name of CONVENTIONS.md: "sensor", "tool", "base".
        sequence: The sender's own number of the record.
        status: The sensor's status word; 0 where it sends none.
        flags: What is wrong with it.
    """

    controller_time: float
    host_time: float
    wrench: Annotated[Array, Column("6", nan=True, inf=True)]
    frame: str
    sequence: int
    status: int = 0
    flags: Flag = Flag.NONE

    def _check_rules(self) -> None:
        """Checks the values: as those of a block of one row."""
        wrenches, flags = check_wrenches(self.wrench[None], np.array([int(self.flags)]))
        self._set_column("wrench", wrenches[0])
        object.__setattr__(self, "flags", Flag(int(flags[0])))

    @property
    def valid(self) -> bool:
        """Whether an estimate may use it."""
        return not self.flags & Flag.INVALID


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """How far the robot is to leave its programmed path.

    Attributes:
        shift: (3,) m in the frame of the controller's correction.
        turn: (3,) rad, rotation vector in the same frame.
        mode: Whether the controller adds it up in every cycle; there is no default.
    """

    shift: Array
    turn: Array
    mode: CorrectionMode

    def __post_init__(self) -> None:
        """Freezes and checks; a correction that is not finite never reaches a robot."""
        if not _is_settled(self.shift):
            object.__setattr__(self, "shift", frozen(self.shift, (3,), "shift"))
        if not _is_settled(self.turn):
            object.__setattr__(self, "turn", frozen(self.turn, (3,), "turn"))


def _is_settled(vector: Array) -> bool:
    """Whether ``frozen`` would leave it as it is; asked while a controller waits."""
    return (
        isinstance(vector, np.ndarray)
        and not vector.flags.writeable
        and vector.shape == (3,)
        and vector.dtype == np.float64
        and math.isfinite(sum(vector.tolist()))
    )


def unknown_pose() -> Array:
    """Returns the (4, 4) of NaN that stands for a pose that was not sent."""
    return np.full((4, 4), np.nan)


def no_correction(mode: CorrectionMode) -> Correction:
    """Returns the correction that leaves the robot on its path (absolute) or where it is."""
    return Correction(shift=np.zeros(3), turn=np.zeros(3), mode=mode)


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
