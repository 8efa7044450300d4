"""What streams carry: joints, forces and corrections, each with its clocks and what is wrong."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG
from robotrue.dynamics.force import MOST
from robotrue.errors import ShapeError

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
class JointSample:
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
    joints: Array
    T_frame_tool: Array
    sequence: int
    flags: Flag = Flag.NONE

    def __post_init__(self) -> None:
        """Freezes and checks."""
        joints, wrong = _cleaned(self.joints, MOST_TURNS)
        pose, wrong_pose = _cleaned_pose(self.T_frame_tool)
        object.__setattr__(self, "joints", frozen(joints, (None,), "joints", allow_nan=True))
        object.__setattr__(
            self, "T_frame_tool", frozen(pose, (4, 4), "T_frame_tool", allow_nan=True)
        )
        object.__setattr__(self, "flags", Flag(self.flags) | wrong | wrong_pose)

    @property
    def valid(self) -> bool:
        """Whether an estimate may use it."""
        return not self.flags & Flag.INVALID


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSample:
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
    wrench: Array
    frame: str
    sequence: int
    status: int = 0
    flags: Flag = Flag.NONE

    def __post_init__(self) -> None:
        """Freezes and checks."""
        wrench = np.asarray(self.wrench, dtype=np.float64)
        if wrench.shape != (6,):
            raise ShapeError(f"wrench has shape {wrench.shape}, expected (6,).")
        measured = 3 if np.isnan(wrench[3:]).all() else 6
        head, wrong = _cleaned(wrench[:measured], STRONGEST[:measured])
        wrench = np.concatenate([head, wrench[measured:]])
        object.__setattr__(self, "wrench", frozen(wrench, (6,), "wrench", allow_nan=True))
        object.__setattr__(self, "flags", Flag(self.flags) | wrong)

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


def _cleaned(values: Array, most: float | Array) -> tuple[Array, Flag]:
    values = np.asarray(values, dtype=np.float64)
    size = np.abs(values)
    if (size <= most).all():
        return values, Flag.NONE
    flags = Flag.NONE if np.isfinite(values).all() else Flag.NOT_FINITE
    if (np.isfinite(values) & (size > most)).any():
        flags |= Flag.IMPLAUSIBLE
    return np.where(size <= most, values, np.nan), flags


def _cleaned_pose(pose: Array) -> tuple[Array, Flag]:
    """A pose is known whole or not at all: half a pose has no use and hides well."""
    pose = np.asarray(pose, dtype=np.float64)
    if pose.shape != (4, 4):
        raise ShapeError(f"T_frame_tool has shape {pose.shape}, expected (4, 4).")
    if np.isnan(pose).all():
        return pose, Flag.NONE
    if not np.isfinite(pose).all():
        return unknown_pose(), Flag.NOT_FINITE
    if np.abs(pose[:3, 3]).max() > FARTHEST:
        return unknown_pose(), Flag.IMPLAUSIBLE
    return pose, Flag.NONE
