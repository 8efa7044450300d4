"""Samples one by one, as the blocks of the product must hold them row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ShapeError
from robotrue.online.blocks import (
    Flag,
    ForceBlock,
    JointBlock,
    check_joints,
    check_poses,
    check_wrenches,
)


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


def unknown_pose() -> Array:
    """Returns the (4, 4) of NaN that stands for a pose that was not sent."""
    return np.full((4, 4), np.nan)


def joint_block(samples: Sequence[JointSample]) -> JointBlock:
    """Returns samples of one stream as a block.

    Raises:
        ShapeError: None, or arms of different numbers of joints.
    """
    _some(samples)
    if len({len(s.joints) for s in samples}) > 1:
        raise ShapeError("samples of arms with different numbers of joints in one stream.")
    return JointBlock(
        controller_time=np.array([s.controller_time for s in samples]),
        host_time=np.array([s.host_time for s in samples]),
        joints=np.array([s.joints for s in samples]),
        T_frame_tool=np.array([s.T_frame_tool for s in samples]),
        sequence=np.array([s.sequence for s in samples], dtype=np.int64),
        flags=np.array([int(s.flags) for s in samples], dtype=np.int64),
    )


def force_block(samples: Sequence[ForceSample]) -> ForceBlock:
    """Returns samples of one stream as a block.

    Raises:
        ShapeError: None, or in different frames.
    """
    _some(samples)
    if len({s.frame for s in samples}) > 1:
        raise ShapeError("forces in different frames in one stream.")
    return ForceBlock(
        controller_time=np.array([s.controller_time for s in samples]),
        host_time=np.array([s.host_time for s in samples]),
        wrench=np.array([s.wrench for s in samples]),
        frame=samples[0].frame,
        sequence=np.array([s.sequence for s in samples], dtype=np.int64),
        status=np.array([s.status for s in samples], dtype=np.int64),
        flags=np.array([int(s.flags) for s in samples], dtype=np.int64),
    )


def _some(samples: Sequence[Any]) -> None:
    if not samples:
        raise ShapeError("a block of no samples, expected one or more.")
