"""Consecutive samples of one stream as arrays: what sources give and estimators take.

A block of one row is a sample. How a stream is cut into blocks changes nothing but speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.errors import ShapeError
from robotrue.online.samples import Flag, ForceSample, JointSample


@dataclass(frozen=True, slots=True, kw_only=True)
class JointBlock(Columns):
    """Joint samples in the order they came.

    Attributes:
        controller_time: (n,) s on the controller's clock; NaN where it sends none.
        host_time: (n,) s on the receiving computer's monotonic clock.
        joints: (n, dof) rad as the controller displays them.
        T_frame_tool: (n, 4, 4) m, the tool point in the controller's frame; NaN where not known.
        sequence: (n,) the sender's numbers.
        flags: (n,) :class:`~robotrue.online.samples.Flag` values.
    """

    controller_time: Annotated[Array, Column("n", unit="s", nan=True)]
    host_time: Annotated[Array, Column("n", unit="s", nan=True)]
    joints: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    T_frame_tool: Annotated[Array, Column("n 4 4", nan=True)]
    sequence: Annotated[IntArray, Column("n")]
    flags: Annotated[IntArray, Column("n")]

    def __len__(self) -> int:
        return len(self.host_time)

    @property
    def valid(self) -> BoolArray:
        """(n,), whether an estimate may use each."""
        return np.asarray((self.flags & int(Flag.INVALID)) == 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBlock(Columns):
    """Force samples in the order they came.

    Attributes:
        controller_time: (n,) s on the sensor's clock; NaN where it sends none.
        host_time: (n,) s on the receiving computer's monotonic clock.
        wrench: (n, 6) N and N m, force first; torques NaN where only forces are measured.
        frame: Frame of its axes: "sensor", "tool", "base".
        sequence: (n,) the sender's numbers.
        status: (n,) status words; 0 where it sends none.
        flags: (n,) :class:`~robotrue.online.samples.Flag` values.
    """

    controller_time: Annotated[Array, Column("n", unit="s", nan=True)]
    host_time: Annotated[Array, Column("n", unit="s", nan=True)]
    wrench: Annotated[Array, Column("n 6", nan=True)]
    frame: str
    sequence: Annotated[IntArray, Column("n")]
    status: Annotated[IntArray, Column("n")]
    flags: Annotated[IntArray, Column("n")]

    def __len__(self) -> int:
        return len(self.host_time)

    @property
    def valid(self) -> BoolArray:
        """(n,), whether an estimate may use each."""
        return np.asarray((self.flags & int(Flag.INVALID)) == 0)


Block = JointBlock | ForceBlock


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
