"""Why a record has frames of its own: the same force blocks as Arrow IPC, by cost and by damage.

python benchmarks/record_formats.py
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable

import numpy as np
import pyarrow as pa

from robotrue.online.blocks import ForceBlock
from robotrue.online.record_frames import (
    HEAD,
    Kind,
    frame_bytes,
    head_length,
    is_sound,
)

ROWS = (20, 28, 100, 512)
FLIPS = 2000
END = 8
"""Bytes of the mark that ends a stream."""
SCHEMA = pa.schema(
    [
        ("controller_time", pa.float64()),
        ("host_time", pa.float64()),
        ("wrench", pa.list_(pa.float64(), 6)),
        ("sequence", pa.int64()),
        ("status", pa.int64()),
        ("flags", pa.int64()),
    ]
)


def main() -> None:
    for rows in ROWS:
        block = force_block(rows)
        own = best(lambda block=block: frame_bytes(Kind.FORCE, 0, block))
        writer = pa.ipc.new_stream(io.BytesIO(), SCHEMA)
        arrow = best(lambda block=block, writer=writer: writer.write_batch(batch(block)))
        sizes = (
            len(frame_bytes(Kind.FORCE, 0, block)),
            len(stream(block, 2)) - len(stream(block, 1)),
        )
        print(
            f"block of {rows:4d}: own {own * 1e6:6.1f} us CPU, {sizes[0]:6d} bytes; "
            f"Arrow IPC {arrow * 1e6:6.1f} us, {sizes[1]:6d} bytes"
        )
    block = force_block(28)
    data = stream(block, 20)
    print(f"Arrow IPC cut at each of {len(data) + 1} places: {lost_at_cuts(block)} lose a batch")
    print(f"{FLIPS} flipped bits, other numbers read without an error:")
    print(f"  own frames {silent_in_frames(block)}, Arrow IPC {silent_in_arrow(block)}")


def force_block(rows: int) -> ForceBlock:
    return ForceBlock(
        controller_time=np.arange(rows) * 1e-3,
        host_time=np.arange(rows) * 1e-3 + 1.0,
        wrench=np.random.default_rng(1).normal(size=(rows, 6)),
        frame="sensor",
        sequence=np.arange(rows),
        status=np.zeros(rows, dtype=np.int64),
        flags=np.zeros(rows, dtype=np.int64),
    )


def batch(block: ForceBlock) -> pa.RecordBatch:
    columns = {name: pa.array(getattr(block, name)) for name in SCHEMA.names if name != "wrench"}
    columns["wrench"] = pa.FixedSizeListArray.from_arrays(pa.array(block.wrench.ravel()), 6)
    return pa.RecordBatch.from_arrays([columns[name] for name in SCHEMA.names], schema=SCHEMA)


def stream(block: ForceBlock, count: int) -> bytes:
    sink = io.BytesIO()
    writer = pa.ipc.new_stream(sink, SCHEMA)
    for _ in range(count):
        writer.write_batch(batch(block))
    writer.close()
    return sink.getvalue()


def best(work: Callable[[], object], calls: int = 2000) -> float:
    """CPU s of a call, the best of seven runs."""
    times = []
    for _ in range(7):
        begun = time.process_time()
        for _ in range(calls):
            work()
        times.append((time.process_time() - begun) / calls)
    return min(times)


def silent_in_frames(block: ForceBlock) -> int:
    data = frame_bytes(Kind.FORCE, 0, block)
    silent = 0
    for damaged in flipped(data, 0):
        head, payload = damaged[: HEAD.size], damaged[HEAD.size :]
        silent += head_length(head) == len(payload) and is_sound(head, payload)
    return silent


def silent_in_arrow(block: ForceBlock) -> int:
    first = len(stream(block, 1)) - END
    whole = pa.ipc.open_stream(stream(block, 2)).read_all()
    silent = 0
    for damaged in flipped(stream(block, 2), first):
        try:
            found = pa.ipc.open_stream(damaged).read_all()
        except (pa.ArrowInvalid, OSError):
            continue
        silent += found.num_rows == whole.num_rows and not found.equals(whole)
    return silent


def lost_at_cuts(block: ForceBlock) -> int:
    """At how many places a stream that is cut there gives back fewer batches than were whole."""
    ends = [len(stream(block, count)) - END for count in range(1, 21)]
    data = stream(block, 20)
    lost = 0
    for cut in range(len(data) + 1):
        count = 0
        try:
            for _ in pa.ipc.open_stream(data[:cut]):
                count += 1
        except (pa.ArrowInvalid, OSError):
            pass
        lost += count < sum(end <= cut for end in ends)
    return lost


def flipped(data: bytes, first: int) -> list[bytes]:
    rng = np.random.default_rng(2)
    out = []
    for place in rng.integers(first, len(data), FLIPS).tolist():
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        out.append(bytes(damaged))
    return out


if __name__ == "__main__":
    main()
