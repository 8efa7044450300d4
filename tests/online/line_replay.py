"""Recorded streams as the samples they were, line by line: what the reader of blocks must give.

Joints: ``t_s,a1_deg..a6_deg``, with ``x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg`` of the tool point if
recorded. Force: ``t_s,fx_N,fy_N,fz_N``, with ``tx_Nm,ty_Nm,tz_Nm`` and ``status`` if recorded.
Both may have ``host_s`` and ``sequence``. A cell that is empty or ``nan`` is a value that was not
valid: its sample is marked, not dropped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from single_samples import ForceSample, JointSample, unknown_pose

from robotrue.core.arrays import Array
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.online.blocks import Flag
from robotrue.online.rdt import LATCHED
from robotrue.online.replay_columns import CLOCKS, FORCE, JOINTS, POSE, TIME, TORQUE
from robotrue.online.sequence import SequenceState, advance

JUMP: Final = 1.0
"""s; a recorded clock that goes back by less is a packet out of order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """One line: its numbers by name, and what its clocks say."""

    cells: dict[str, float]
    time: float
    host_time: float
    sequence: int
    flags: Flag

    def numbers(self, names: tuple[str, ...]) -> Array:
        return np.array([self.cells[name] for name in names])


def replay_joints(path: str | Path) -> Iterator[JointSample]:
    """Gives the joint samples of a CSV in their order, holding one line at a time.

    Raises:
        FormatError: Unreadable, a column missing, unknown or without unit, a cell that is no
            number; with its line. A last line without its end was cut short and is left out.
    """
    for row in _rows(path, (*TIME, *JOINTS), (POSE,), CLOCKS):
        pose, flags = unknown_pose(), row.flags
        if POSE[0] in row.cells:
            numbers = row.numbers(POSE)
            if np.isfinite(numbers).all():
                # rx, ry, rz are KUKA's C, B, A
                pose = pose_from_xyz_abc(numbers[:3] * MM, numbers[:2:-1] * DEG)
            else:
                flags |= Flag.NOT_FINITE
        yield JointSample(
            controller_time=row.time,
            host_time=row.host_time,
            joints=row.numbers(JOINTS) * DEG,
            T_frame_tool=pose,
            sequence=row.sequence,
            flags=flags,
        )


def replay_force(path: str | Path, *, frame: str = "sensor") -> Iterator[ForceSample]:
    """Gives the force samples of a CSV or TDMS file in their order.

    A CSV is held one line at a time; a TDMS file is read whole, and has no torques here.

    Args:
        path: ``.tdms`` or anything else as CSV.
        frame: Frame the forces were recorded in.

    Raises:
        FormatError: As :func:`replay_joints`.
        ImplausibleDataError: A TDMS record that no sensor can have made.
        MissingExtraError: TDMS without npTDMS.
    """
    if Path(path).suffix.lower() == ".tdms":
        yield from _tdms(path, frame)
        return
    for row in _rows(path, (*TIME, *FORCE), (TORQUE,), (*CLOCKS, "status")):
        torque = row.numbers(TORQUE) if TORQUE[0] in row.cells else np.full(3, np.nan)
        flags = row.flags
        if TORQUE[0] in row.cells and np.isnan(torque).any():
            flags |= Flag.NOT_FINITE
        printed = row.cells.get("status", 0.0)
        status = int(printed) if 0.0 <= printed < 2.0**32 else -1
        if status & ~LATCHED:
            flags |= Flag.SENSOR_FAULT
        yield ForceSample(
            controller_time=row.time,
            host_time=row.host_time,
            wrench=np.concatenate([row.numbers(FORCE), torque]),
            frame=frame,
            sequence=row.sequence,
            status=status,
            flags=flags,
        )


def _tdms(path: str | Path, frame: str) -> Iterator[ForceSample]:
    from robotrue.dynamics.formats.signal_table import read_force

    record, _ = read_force(path)
    for i, (time, force) in enumerate(zip(record.time.tolist(), record.force, strict=True)):
        yield ForceSample(
            controller_time=time,
            host_time=time,
            wrench=np.concatenate([force, np.full(3, np.nan)]),
            frame=frame,
            sequence=i,
        )


def _rows(
    path: str | Path,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
) -> Iterator[_Row]:
    names: tuple[str, ...] = ()
    watch = SequenceState()
    latest = -math.inf
    count = 0
    for line, text in _lines(path):
        if not names:
            names = header_names(text, path, line, needed, groups, optional)
            continue
        cells = dict(zip(names, cells_of(text, names, path, line), strict=True))
        time = cells["t_s"]
        host = cells.get("host_s", time)
        sequence = whole(cells.get("sequence", float(count)), path, line)
        flags = Flag.NONE
        if math.isnan(time) or math.isnan(host):
            flags |= Flag.NOT_FINITE | Flag.CLOCK_JUMP
        elif "sequence" in cells:
            watch, flags = advance(watch, sequence, host)
        else:
            flags = _order(time, latest)
            latest = time if flags & Flag.CLOCK_JUMP else max(time, latest)
        count += 1
        yield _Row(cells=cells, time=time, host_time=host, sequence=sequence, flags=flags)
    if not names or not count:
        raise FormatError("no rows.", source=path, hint="was the recording ever started?")


def _order(time: float, latest: float) -> Flag:
    if time > latest:
        return Flag.NONE
    if time == latest:
        return Flag.REPEATED
    return Flag.CLOCK_JUMP if latest - time > JUMP else Flag.REORDERED


def _lines(path: str | Path) -> Iterator[tuple[int, str]]:
    """Gives the lines that are whole, with their numbers; blank and ``#`` lines are left out."""
    try:
        with Path(path).open("rb") as stream:
            for number, raw in enumerate(stream, start=1):
                if not raw.endswith(b"\n"):
                    return  # a number cut short still looks like a number
                try:
                    text = raw.decode("utf-8-sig" if number == 1 else "utf-8").strip()
                except UnicodeDecodeError as cause:
                    raise FormatError("not text in UTF-8.", source=path, line=number) from cause
                if text and not text.startswith("#"):
                    yield number, text
    except OSError as cause:
        raise FormatError(
            f"cannot read: {cause.strerror}.", source=path, hint="check the path."
        ) from cause


def header_names(
    text: str,
    path: str | Path,
    line: int,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
) -> tuple[str, ...]:
    """Returns the names of the columns.

    Args:
        text: The line.
        path: Of the message.
        line: Of the message.
        needed: Columns that have to be there.
        groups: Columns that are there together or not at all.
        optional: Columns that may be there.

    Raises:
        FormatError: A column missing, not known or twice.
    """
    names = tuple(name.strip() for name in text.split(","))
    known = {*needed, *optional, *(name for group in groups for name in group)}
    unknown = [name for name in names if name not in known]
    missing = [name for name in needed if name not in names]
    for group in groups:
        if any(name in names for name in group):
            missing += [name for name in group if name not in names]
    if unknown or missing or len(set(names)) != len(names):
        raise FormatError(
            f"columns {','.join(names)}: "
            + (f"missing {', '.join(missing)}." if missing else "")
            + (f"not known {', '.join(unknown)}." if unknown else "")
            + ("" if missing or unknown else "one occurs twice."),
            source=path,
            line=line,
            hint=f"{','.join(needed)} and, where recorded, {','.join(sorted(known - {*needed}))}.",
        )
    return names


def cells_of(text: str, names: tuple[str, ...], path: str | Path, line: int) -> list[float]:
    """Returns the numbers of a line, NaN for an empty cell.

    Raises:
        FormatError: Another number of cells, or one that is no number.
    """
    cells = text.split(",")
    if len(cells) != len(names):
        raise FormatError(
            f"{len(cells)} cells, expected {len(names)}.",
            source=path,
            line=line,
            hint="a decimal comma?",
        )
    try:
        return [float(cell) if cell.strip() else math.nan for cell in cells]
    except ValueError as cause:
        raise FormatError(f"no number: {cause}.", source=path, line=line) from cause


def whole(value: float, path: str | Path, line: int) -> int:
    """Returns a sequence number.

    Raises:
        ImplausibleDataError: Not a whole number from 0.
    """
    if not (0.0 <= value < 2.0**53 and value == int(value)):
        raise ImplausibleDataError(
            f"sequence {value:g}, expected a whole number from 0.", source=path, line=line
        )
    return int(value)
