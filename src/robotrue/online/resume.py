"""Going on with a record: the chain as it was at the last frame, and what its sinks have missed.

The last checkpoint is restored and what came in after it goes through the chain again. The
estimates that come out must be those of the record, bit for bit; whatever the record does not have
yet comes after them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.estimates import EstimateBlock
from robotrue.online.record import StreamRecord
from robotrue.online.record_frames import Kind, RecordFrame
from robotrue.online.sensing_chain import SensingChain, Stream

_SAMPLES = (Kind.JOINTS, Kind.FORCE, Kind.ESTIMATES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumed:
    """Position at which a record ended.

    Attributes:
        rows: Samples of each stream that the chain has taken: the sources continue after them.
        missing: Estimates that were made of them and are not in the record.
        again: Estimates in the record that will come once more (made at the end of a stream).
        checked: Estimates made again and found equal to those of the record.
    """

    rows: dict[Stream, int]
    missing: list[EstimateBlock]
    again: int
    checked: int


def resume(record: StreamRecord, chain: SensingChain) -> Resumed:
    """Returns where a record ended, and brings a fresh chain there.

    Raises:
        ModelMismatchError: The chain makes other estimates than those of the record.
        FormatError: No record, or damaged inside.
    """
    made: deque[EstimateBlock] = deque()
    checked = again = 0
    for frame in _since_checkpoint(record):
        if frame.kind is Kind.CHECKPOINT:
            chain.restore(frame.content)
        elif frame.kind is Kind.JOINTS:
            made.extend(chain.joints(frame.content))
        elif frame.kind is Kind.FORCE:
            made.extend(chain.force(frame.content))
        else:
            compared = _compare_estimates(frame, made)
            checked += compared
            again += len(frame.content) - compared
    return Resumed(rows=dict(chain.rows), missing=list(made), again=again, checked=checked)


def read_estimates_after(
    record: StreamRecord, line: str | None, before: int
) -> Iterator[EstimateBlock]:
    """Yields the recorded estimates after the one in a given line of a CSV file.

    Args:
        record: Where they are.
        line: Last line of the file; None gives all.
        before: Number of the first frame that is not to be given any more.

    Raises:
        ConfigurationError: The record has no such estimate.
    """
    begun, block = line is None, None
    found = record.segments()
    if line is not None:
        host, sequence = [*line.split(","), "", ""][:2]
        while len(found) > 1 and not _from_before(record, found[-1], float(host or "nan")):
            found.pop()
        found = [found[-1], *record.segments()[len(found) :]]
    for segment in found:
        for frame in record.segment_frames(segment, (Kind.ESTIMATES,), skip_damage=True):
            if frame.number >= before:
                return
            block = frame.content
            if begun:
                yield block
            elif (row := _find_row(block, host, sequence)) is not None:
                begun = True
                if row + 1 < len(block):
                    yield block.take(slice(row + 1, None))
    if not begun and later_than(block, line) is None:
        return  # the file is ahead of the record
    if not begun:
        raise ConfigurationError(
            f"the file ends with an estimate that is not in the record: {line!r}.",
            source=record.path,
            hint="the file of this record, or another name.",
        )


def later_than(block: EstimateBlock | None, line: str | None) -> EstimateBlock | None:
    """Returns the rows of a block after the one in a line of a CSV file, None if there are none."""
    if block is None or line is None:
        return block
    host, sequence = [*line.split(","), "", ""][:2]
    time = np.round(block.host_time, 9)
    at = float(host or "nan")
    rows = np.flatnonzero((time > at) | ((time == at) & (block.sequence > int(sequence or -1))))
    return block.take(slice(int(rows[0]), None)) if len(rows) else None


def _since_checkpoint(record: StreamRecord) -> Iterator[RecordFrame]:
    """Gives the last checkpoint, if there is one, and the samples after it."""
    path, last = record.segments(), None
    start = len(path)
    while start and last is None:
        start -= 1
        for frame in record.segment_frames(path[start], (Kind.CHECKPOINT,)):
            last = frame
    if last is not None:
        yield last
    for segment in path[start:]:
        for frame in record.segment_frames(segment, _SAMPLES):
            if last is None or frame.number > last.number:
                yield frame


def _compare_estimates(frame: RecordFrame, made: deque[EstimateBlock]) -> int:
    """Removes the rows of a frame from ``made``; returns the number of compared rows."""
    block: EstimateBlock = frame.content
    done = 0
    while done < len(block) and made:
        head = made.popleft()
        n = min(len(head), len(block) - done)
        one, other = head.take(slice(n)), block.take(slice(done, done + n))
        for name in (field.name for field in fields(block)):
            if not np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True):
                raise ModelMismatchError(
                    f"{name} of frame {frame.number} differs from the result of these models for "
                    "the recorded samples.",
                    hint="the cell, models and options of the start of the record.",
                )
        if n < len(head):
            made.appendleft(head.take(slice(n, None)))
        done += n
    return done


def _from_before(record: StreamRecord, segment: Path, host: float) -> bool:
    """True if a segment begins with estimates up to a given time."""
    for frame in record.segment_frames(segment, (Kind.ESTIMATES,), skip_damage=True):
        return bool(frame.content.host_time[0] <= host + 1e-9)
    return False


def _find_row(block: EstimateBlock, host: str, sequence: str) -> int | None:
    for row in np.flatnonzero(block.sequence == int(sequence or -1)).tolist():
        if f"{block.host_time[row]:.9f}" == host:
            return int(row)
    return None
