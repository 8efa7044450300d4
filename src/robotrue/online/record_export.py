"""Streams of a record as the CSV files that a replay reads, and its estimates as a CSV sink's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.csv_sink import estimate_columns, estimate_lines
from robotrue.online.estimates import EstimateBlock
from robotrue.online.record import RecordHeader, StreamRecord
from robotrue.online.record_frames import Kind
from robotrue.online.replay_columns import FORCE, JOINTS, POSE, TORQUE

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
    """Gives the header and then the lines of each block of a stream, with how many they are.

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
