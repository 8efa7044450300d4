"""Blocks with known numbers, for records and the service."""

from __future__ import annotations

import numpy as np

from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import Doubt, EstimateBlock
from robotrue.online.record import RecordHeader

HEADER = RecordHeader(
    addresses={"robot": "replay:joints.csv", "force": "replay:force.csv"},
    provenance={"cell": "ab12"},
    settings={"rate": 1000.0},
    started="2026-05-04T10:00:00+00:00",
    host_to_utc=1.7e9,
)


def joint_rows(first: int, n: int, *, period: float = 4e-3, late: float = 0.0) -> JointBlock:
    """A wrist that swings; row k of the stream is the same however the stream is cut."""
    count = np.arange(first, first + n)
    time = count * period
    joints = 0.3 * np.sin(time[:, None] * np.arange(1.0, 7.0))
    return JointBlock(
        controller_time=time,
        host_time=time + late,
        joints=joints,
        T_frame_tool=np.full((n, 4, 4), np.nan),
        sequence=count,
        flags=np.zeros(n, dtype=np.int64),
    )


def force_rows(first: int, n: int, *, period: float = 1e-3, late: float = 0.0) -> ForceBlock:
    """A force that swings; torques are not measured."""
    count = np.arange(first, first + n)
    time = count * period
    wrench = np.full((n, 6), np.nan)
    wrench[:, :3] = 50.0 * np.sin(7.0 * time[:, None] + np.arange(3.0))
    return ForceBlock(
        controller_time=time,
        host_time=time + late,
        wrench=wrench,
        frame="sensor",
        sequence=count,
        status=np.zeros(n, dtype=np.int64),
        flags=np.zeros(n, dtype=np.int64),
    )


def estimate_rows(first: int, n: int) -> EstimateBlock:
    """Errors of some micrometres, every seventh row invalid."""
    count = np.arange(first, first + n)
    doubt = np.where(count % 7 == 0, int(Doubt.BAD_FORCE), 0)
    error = 1e-6 * np.cos(count[:, None] * np.arange(1.0, 4.0))
    return EstimateBlock(
        host_time=count * 1e-3,
        error=np.where(doubt[:, None] > 0, np.nan, error),
        sd=np.where(doubt[:, None] > 0, np.nan, 1e-7 + np.zeros((n, 3))),
        static=error * 0.5,
        wrench=np.where(doubt[:, None] > 0, np.nan, 3.0 + np.zeros((n, 6))),
        joints=np.tile(np.arange(6.0), (n, 1)),
        sequence=count,
        doubt=doubt,
    )


def same(one: object, other: object) -> bool:
    """Whether two blocks are equal bit for bit, NaN included."""
    names = type(one).__dataclass_fields__
    return type(one) is type(other) and all(
        np.asarray(getattr(one, n)).tobytes() == np.asarray(getattr(other, n)).tobytes()
        for n in names
    )
