"""Recorded streams as blocks, from the tables of :mod:`robotrue.online.replay_columns`.

A record can be repeated: its times and counts go on where it ended, and so do the clocks that are
watched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.blocks import (
    Flag,
    ForceBlock,
    JointBlock,
    SampleBlock,
    check_joints,
    check_poses,
    check_wrenches,
)
from robotrue.online.rdt import LATCHED
from robotrue.online.replay_columns import (
    CLOCKS,
    FORCE,
    JOINTS,
    POSE,
    TIME,
    TORQUE,
    read_columns,
    read_tdms_table,
)
from robotrue.online.sequence import SequenceState, advance_block, in_order

_KEPT: Final = 20_000_000
"""Numbers of a record that is repeated and small enough to be kept: 160 MB."""
JUMP: Final = 1.0
"""s; a recorded clock that goes back by less is a packet out of order."""
_UNKNOWN: Final = int(Flag.NOT_FINITE | Flag.CLOCK_JUMP)
Table = tuple[tuple[str, ...], Array]
B = TypeVar("B")


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """Number and period of the repetitions of a record.

    Attributes:
        times: How often; None for ever.
        period: s from one beginning to the next; None takes the record's own length. Two records
            that belong together need the same.
    """

    times: int | None = 1
    period: float | None = None

    def __post_init__(self) -> None:
        """Checks."""
        if (self.times is not None and self.times < 1) or not (
            self.period is None or 0.0 < self.period < math.inf
        ):
            raise ConfigurationError(
                f"a record repeated {self.times} times every {self.period} s, expected once or "
                "more and a period above zero."
            )


def joint_blocks(path: str | Path, repeats: Repeats | None = None) -> Iterator[JointBlock]:
    """Gives the joint samples of a CSV in their order.

    Raises:
        FormatError: As :func:`robotrue.online.replay_columns.read_columns`.
        ConfigurationError: A period shorter than the record.
    """

    def tables() -> Iterator[Table]:
        return read_columns(path, (*TIME, *JOINTS), (POSE,), CLOCKS)

    return _play(tables, repeats or Repeats(), _joints, path)


def force_blocks(
    path: str | Path, repeats: Repeats | None = None, *, frame: str = "sensor"
) -> Iterator[ForceBlock]:
    """Gives the force samples of a CSV or TDMS file in their order.

    Args:
        path: ``.tdms`` or anything else as CSV.
        repeats: How often.
        frame: Frame the forces were recorded in.

    Raises:
        FormatError: As :func:`robotrue.online.replay_columns.read_columns`.
        ImplausibleDataError: A TDMS record that no sensor can have made.
        MissingExtraError: TDMS without npTDMS.
        ConfigurationError: A period shorter than the record.
    """

    def tables() -> Iterator[Table]:
        if Path(path).suffix.lower() == ".tdms":
            return read_tdms_table(path)
        return read_columns(path, (*TIME, *FORCE), (TORQUE,), (*CLOCKS, "status"))

    def block(names: tuple[str, ...], table: Array, clock: SampleBlock) -> ForceBlock:
        return _force(names, table, clock, frame)

    return _play(tables, repeats or Repeats(), block, path)


class _Watch:
    """The clocks of a stream across its tables, and where the present repetition begins."""

    def __init__(self) -> None:
        self._state = SequenceState()
        self._latest = -math.inf
        self._rows = 0
        self._shift = 0.0
        self._ahead = 0
        self._first, self._last = math.inf, -math.inf
        self._lowest, self._highest = math.inf, -math.inf
        self._passed = 0

    def clock(self, names: tuple[str, ...], table: Array) -> SampleBlock:
        """Returns clocks and flags of the next rows, after the repetitions before them."""
        printed = table[:, names.index("t_s")]
        time = printed + self._shift
        host = time
        if "host_s" in names:
            host = table[:, names.index("host_s")] + self._shift
        counted = "sequence" in names
        if counted:
            count = table[:, names.index("sequence")].astype(np.int64)
            self._lowest = min(self._lowest, float(count.min()))
            self._highest = max(self._highest, float(count.max()))
            sequence = count + self._ahead
        else:
            sequence = self._rows + np.arange(len(table))
        known = ~(np.isnan(time) | np.isnan(host))
        flags = np.full(len(table), _UNKNOWN, dtype=np.int64)
        if counted:
            self._state, flags[known] = advance_block(self._state, sequence[known], host[known])
        else:
            self._latest, flags[known] = in_order(self._latest, time[known], JUMP)
        if known.any():
            self._first = min(self._first, float(printed[known].min()))
            self._last = max(self._last, float(printed[known].max()))
        self._rows += len(table)
        return SampleBlock(controller_time=time, host_time=host, sequence=sequence, flags=flags)

    def again(self, period: float | None, path: str | Path) -> None:
        """Restarts the record from its beginning; later times are shifted by its length."""
        rows = self._rows - self._passed
        length = self._last - self._first
        if not (rows > 1 and 0.0 < length < math.inf):
            raise FormatError("a record without length cannot be repeated.", source=path)
        own = length * rows / (rows - 1)
        if period is not None and period <= length:
            raise ConfigurationError(
                f"a period of {period:g} s for a record of {length:g} s.",
                source=path,
                hint=f"period={own:.6g}s or more; both records of a pair need the same.",
            )
        self._shift += own if period is None else period
        self._ahead += int(self._highest - self._lowest) + 1 if self._highest > 0 else 0
        self._passed = self._rows


def _play(
    tables: Callable[[], Iterator[Table]],
    repeats: Repeats,
    block: Callable[[tuple[str, ...], Array, SampleBlock], B],
    path: str | Path,
) -> Iterator[B]:
    watch = _Watch()
    kept: list[Table] | None = [] if repeats.times != 1 else None
    numbers, done = 0, 0
    for names, table in tables():
        numbers += table.size
        if kept is not None:
            kept.append((names, table))
            kept = kept if numbers <= _KEPT else None
        yield block(names, table, watch.clock(names, table))
    while (done := done + 1) != repeats.times:
        watch.again(repeats.period, path)
        for names, table in tables() if kept is None else kept:
            yield block(names, table, watch.clock(names, table))


def _joints(names: tuple[str, ...], table: Array, clock: SampleBlock) -> JointBlock:
    joints, flags = check_joints(_pick_columns(names, table, JOINTS) * DEG, clock.flags)
    poses = np.full((len(table), 4, 4), np.nan)
    if POSE[0] in names:
        numbers = _pick_columns(names, table, POSE)
        known = np.isfinite(numbers).all(axis=1)
        # rx, ry, rz are KUKA's C, B, A
        poses[known] = pose_from_xyz_abc(numbers[known, :3] * MM, numbers[known, :2:-1] * DEG)
        flags = flags | np.where(known, 0, int(Flag.NOT_FINITE))
        poses, flags = check_poses(poses, flags)
    return JointBlock(
        controller_time=clock.controller_time,
        host_time=clock.host_time,
        joints=joints,
        T_frame_tool=poses,
        sequence=clock.sequence,
        flags=flags,
    )


def _force(names: tuple[str, ...], table: Array, clock: SampleBlock, frame: str) -> ForceBlock:
    wrench = np.full((len(table), 6), np.nan)
    wrench[:, :3] = _pick_columns(names, table, FORCE)
    flags = clock.flags
    if TORQUE[0] in names:
        wrench[:, 3:] = _pick_columns(names, table, TORQUE)
        lost = np.isnan(wrench[:, 3:]).any(axis=1)
        flags = flags | np.where(lost, int(Flag.NOT_FINITE), 0)
    status = np.zeros(len(table), dtype=np.int64)
    if "status" in names:
        printed = table[:, names.index("status")]
        sound = (printed >= 0.0) & (printed < 2.0**32)
        status = np.where(sound, printed, -1.0).astype(np.int64)
    flags = flags | np.where(status & ~LATCHED, int(Flag.SENSOR_FAULT), 0)
    wrench, flags = check_wrenches(wrench, flags)
    return ForceBlock(
        controller_time=clock.controller_time,
        host_time=clock.host_time,
        wrench=wrench,
        frame=frame,
        sequence=clock.sequence,
        status=status,
        flags=flags,
    )


def _pick_columns(names: tuple[str, ...], table: Array, wanted: tuple[str, ...]) -> Array:
    return np.asarray(table[:, [names.index(name) for name in wanted]])
