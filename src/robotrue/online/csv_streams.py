"""Estimates and streams as CSV: of a live sink, and of a record, whose streams a replay reads.

A sink writes whole lines only; at most the last one is unfinished after kill -9. Columns of
estimates: ``host_s`` (monotonic clock of the receiving computer), ``sequence`` (of the force
sample), ``ex_um..ez_um`` (actual minus programmed, base axes), ``sd_x_um..`` (one standard
deviation), ``static_x_um..``, ``fx_N..mz_Nm`` (process wrench on the tool point, base axes),
``a1_deg..`` (axes as displayed), ``doubt`` (names joined by ``+``, ``none``). What is not known is
empty.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from io import FileIO
from itertools import chain, islice
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, ShapeError
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import EstimateBlock, doubt_words, number_columns, numbers
from robotrue.online.link import Health
from robotrue.online.record import RecordHeader, StreamRecord
from robotrue.online.record_frames import Kind
from robotrue.online.replay_columns import FORCE, JOINTS, POSE, TORQUE
from robotrue.online.sinks import SinkSettings

_TAIL: Final = 1 << 16
"""Bytes looked at for the end of the last line; none of ours is as long."""


def estimate_columns(joints: int) -> tuple[str, ...]:
    """Returns the names of the columns, for an arm of so many joints."""
    return ("host_s", "sequence", *number_columns(joints), "doubt")


def estimate_lines(block: EstimateBlock, joints: int) -> bytes:
    """Returns one line for each estimate, in the order of :func:`estimate_columns`.

    Raises:
        ShapeError: The block is of an arm with another number of joints.
    """
    line = "%.9f,%d" + ",%.4f" * len(number_columns(joints)) + ",%s\n"
    words = {int(d): doubt_words(int(d)) for d in set(block.doubt.tolist())}
    values = numbers(block, joints).tolist()
    heads = zip(block.host_time.tolist(), block.sequence.tolist(), strict=True)
    text = "".join(
        line % (*head, *row, words[doubt])
        for head, row, doubt in zip(heads, values, block.doubt.tolist(), strict=True)
    )
    return text.replace("nan", "").encode("ascii")


class CsvSink:
    """A file of estimates.

    A block goes to the operating system in one piece before ``write`` returns, so a process that is
    killed loses no block whose ``write`` returned. A full disk loses blocks, which are counted, and
    never leaves half a line between two whole ones.
    """

    def __init__(self, path: str | Path, settings: SinkSettings) -> None:
        self._path = Path(path)
        self._settings = settings
        self._columns = estimate_columns(settings.joints)
        self._file: FileIO | None = None
        self._size = 0
        self._health = Health(name=f"csv:{self._path}", connected=False)
        self._last: str | None = None

    @property
    def resumed_after(self) -> str | None:
        """The last whole line of the file when it was opened, or None."""
        return self._last

    async def open(self) -> None:
        """Starts the file, or continues after its last whole line where the settings state resume.

        Raises:
            ConfigurationError: The file exists and the settings do not resume.
            FormatError: It is not one of ours with these columns, or cannot be opened.
        """
        await asyncio.to_thread(self._open)

    def _open(self) -> None:
        mark = mark_line(self._settings.provenance)
        header = (mark + ",".join(self._columns) + "\n").encode()
        try:
            file = FileIO(self._path, "a+")
        except OSError as cause:
            raise FormatError(
                f"cannot write: {cause.strerror}.",
                source=self._path,
                hint="check the folder and its permissions.",
            ) from cause
        try:
            self._size = self._find_append_position(file, header)
        except BaseException:
            file.close()
            raise
        self._file = file

    def _find_append_position(self, file: FileIO, header: bytes) -> int:
        """Returns where the next line goes."""
        size = file.seek(0, os.SEEK_END)
        if size == 0:
            return _put(file, header, 0)
        if not self._settings.resume:
            raise ConfigurationError(
                f"there is a file of {size} bytes already, expected none.",
                source=self._path,
                hint="another name, or csv+append: to continue after its last line.",
            )
        begun = _read(file, 0, len(header))
        if begun != header[: len(begun)]:
            raise FormatError(
                f"begins with {begun[:60]!r}, expected the columns {','.join(self._columns)}.",
                source=self._path,
                line=1,
                hint="another name for this file.",
            )
        if len(begun) < len(header):  # killed within the header
            file.truncate(0)
            return _put(file, header, 0)
        tail = _read(file, max(0, size - _TAIL), _TAIL)
        whole = size - len(tail) + tail.rfind(b"\n") + 1
        if whole < len(header):
            raise FormatError(f"the last {_TAIL} bytes have no end of line.", source=self._path)
        if whole < size:
            file.truncate(whole)
            self._health.last_fault = f"an unfinished last line of {size - whole} bytes was cut off"
        lines = tail[: len(tail) - (size - whole)].splitlines()
        self._last = lines[-1].decode("ascii", "replace") if whole > len(header) else None
        return whole

    async def write(self, estimates: EstimateBlock) -> None:
        """Writes one line per estimate; a block not written whole is dropped and counted."""
        if self._file is None:
            self._health.refuse("the file is not open")
            return
        try:
            data = estimate_lines(estimates, self._settings.joints)
        except ShapeError as cause:
            self._health.refuse(str(cause))
            return
        # A stalled disk must not delay the answers to a robot: in a thread.
        await asyncio.to_thread(self._append, self._file, data)

    def _append(self, file: FileIO, data: bytes) -> None:
        try:
            self._size = _put(file, data, self._size)
            self._health.received += 1
        except OSError as cause:
            self._health.refuse(f"cannot write: {cause.strerror}")

    async def close(self) -> None:
        """Brings the lines to the disk and closes the file."""
        if self._file is not None:
            file, self._file = self._file, None
            await asyncio.to_thread(self._finish, file)

    def _finish(self, file: FileIO) -> None:
        try:
            os.fsync(file.fileno())
        except OSError as cause:
            self._health.last_fault = f"cannot write: {cause.strerror}"
        finally:
            file.close()

    def health(self) -> Health:
        """Returns the present counters."""
        return replace(self._health, connected=self._file is not None)


def _put(file: FileIO, data: bytes, size: int) -> int:
    """Returns the size after appending ``data``; all of it or nothing."""
    done = 0
    try:
        while done < len(data):
            done += file.write(data[done:]) or 0
    except OSError:
        file.truncate(size)
        raise
    return size + done


def _read(file: FileIO, at: int, count: int) -> bytes:
    file.seek(at)
    data = b""
    while len(data) < count and (more := file.read(count - len(data))):
        data += more
    return data


Exported: TypeAlias = Literal["joints", "force", "estimates"]
STREAMS: Final[dict[Exported, Kind]] = {
    "joints": Kind.JOINTS,
    "force": Kind.FORCE,
    "estimates": Kind.ESTIMATES,
}
_LOOKED_AT: Final = 16


def export_lines(
    record: StreamRecord, stream: Exported, *, skip_damage: bool = False
) -> Iterator[tuple[bytes, int]]:
    """Yields the header and then the lines of each block of a stream, with their number.

    Times and numbers are printed so that they read back as the same float64; degrees and
    millimetres differ from the recorded rad and m by rounding. Counts that do not grow by one
    (RSI counts milliseconds) are left out: a replay counts rows.

    Raises:
        FormatError: The record has no such stream, or is damaged inside.
    """
    frames = record.frames({STREAMS[stream]}, skip_damage=skip_damage)
    blocks = (frame.content for frame in frames)
    first = list(islice(blocks, _LOOKED_AT))
    if not first:
        raise FormatError(f"the record has no {stream}.", source=record.path)
    every = chain(first, blocks)
    mark = mark_line(stream_provenance(record.header(), stream)).encode()
    if mark:
        yield mark, 0
    if stream == "estimates":
        yield from _estimates(every, max(b.joints.shape[1] for b in first))
        return
    counted = _counts_by_one(np.concatenate([b.sequence for b in first]))
    if stream == "joints":
        posed = not all(np.isnan(b.T_frame_tool).all() for b in first)
        yield from _joints(every, counted, posed)
    else:
        turned = not all(np.isnan(b.wrench[:, 3:]).all() for b in first)
        yield from _forces(every, counted, turned)


def stream_provenance(header: RecordHeader, stream: Exported) -> Provenance:
    """Returns whether a stream of a record is simulated; estimates are if anything is."""
    role = {"joints": "robot", "force": "force"}.get(stream)
    simulated = bool(header.simulated) if role is None else role in header.simulated
    return Provenance(simulated=simulated, instrument="record of the service")


def _joints(
    blocks: Iterable[JointBlock], counted: bool, posed: bool
) -> Iterator[tuple[bytes, int]]:
    yield _header(counted, (*JOINTS, *(POSE if posed else ()))), 0
    for block in blocks:
        if block.joints.shape[1] != len(JOINTS):
            raise FormatError(
                f"joints of an arm of {block.joints.shape[1]}, a replay has {len(JOINTS)}."
            )
        columns = [block.joints / DEG]
        if posed:
            pose = np.full((len(block), 6), np.nan)
            known = ~np.isnan(block.T_frame_tool).any(axis=(1, 2))
            pose[known, :3] = block.T_frame_tool[known, :3, 3] / MM
            # rx, ry, rz are KUKA's C, B, A
            pose[known, 3:] = abc_from_matrix(block.T_frame_tool[known, :3, :3])[:, ::-1] / DEG
            columns.append(pose)
        yield _lines(block, counted, np.hstack(columns)), len(block)


def _forces(
    blocks: Iterable[ForceBlock], counted: bool, turned: bool
) -> Iterator[tuple[bytes, int]]:
    yield _header(counted, (*FORCE, *(TORQUE if turned else ()), "status")), 0
    for block in blocks:
        columns = [block.wrench[:, : 6 if turned else 3], block.status[:, None]]
        yield _lines(block, counted, np.hstack(columns)), len(block)


def _estimates(blocks: Iterable[EstimateBlock], joints: int) -> Iterator[tuple[bytes, int]]:
    yield (",".join(estimate_columns(joints)) + "\n").encode(), 0
    for block in blocks:
        yield estimate_lines(block, joints), len(block)


def _header(counted: bool, names: tuple[str, ...]) -> bytes:
    return (
        ",".join(("t_s", "host_s", *(("sequence",) if counted else ()), *names)) + "\n"
    ).encode()


def _lines(block: JointBlock | ForceBlock, counted: bool, values: Array) -> bytes:
    # where the sender has no clock, the moment it came is the time
    times = np.where(np.isnan(block.controller_time), block.host_time, block.controller_time)
    heads = [times.tolist(), block.host_time.tolist()]
    if counted:
        heads.append(block.sequence.tolist())
    rows = zip(*heads, *values.T.tolist(), strict=True)
    text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    return text.replace("nan", "").encode("ascii")


def _counts_by_one(sequence: IntArray) -> bool:
    steps = np.diff(sequence)
    return bool(len(steps) == 0 or np.median(steps) == 1) and bool((sequence >= 0).all())
