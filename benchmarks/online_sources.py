"""Samples per CPU second of the online sources, one thread.

python benchmarks/online_sources.py
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from robotrue.online import rdt
from robotrue.online.rdt import RECORD, decode_records, rdt_block
from robotrue.online.replay_blocks import force_blocks
from robotrue.online.sequence import advance_block

SCALE = rdt.RdtScale(newton=1e-6, newton_metre=1e-6)
RATE = 7000.0
DEVICE = rdt.RdtDevice.NET
ROWS = 50_000


def main() -> None:
    print("samples per CPU second, one thread")
    for size in (1, 28, 512):
        bulk = _rate(lambda size=size: _rdt_in_bulk(size))
        _say(f"RDT bytes to a block of {size}", bulk)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "force.csv"
        _record(path)
        bulk = _rate(lambda: sum(map(len, force_blocks(path))))
        _say("replay of a CSV of forces", bulk)


def _say(what: str, rate: float) -> None:
    print(f"{what:30s} {rate:12,.0f}")


def _rate(work: Callable[[], int]) -> float:
    """The best of three runs."""
    rates = []
    for _ in range(3):
        begun = time.process_time()
        done = work()
        rates.append(done / (time.process_time() - begun))
    return max(rates)


def _bytes(count: int) -> bytes:
    records = np.zeros(count, dtype=RECORD)
    records["rdt"] = 1 + np.arange(count)
    records["ft"] = 1 + np.arange(count)
    records["counts"] = np.random.default_rng(1).integers(-(10**8), 10**8, size=(count, 6))
    return records.tobytes()


def _rdt_in_bulk(size: int) -> int:
    data = _bytes(size)
    state, before, blocks = rdt.rdt_sequence(RATE), None, max(2, 40_000 // size // 4)
    for k in range(blocks):
        records = decode_records(data)
        count = records["rdt"].astype(np.int64) + k * size
        state, flags = advance_block(state, count, count / RATE)
        block = rdt_block(
            records, SCALE, count / RATE, flags, device=DEVICE, rate=RATE, before=before
        )
        before = int(block.sequence[-1]), -1
    return blocks * size


def _record(path: Path) -> None:
    values = np.random.default_rng(2).normal(scale=100.0, size=(ROWS, 6))
    with path.open("w", encoding="utf-8") as stream:
        stream.write("t_s,sequence,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm\n")
        for k, row in enumerate(values.tolist()):
            stream.write(f"{k / RATE:.6f},{k}," + ",".join(f"{v:.4f}" for v in row) + "\n")


if __name__ == "__main__":
    main()
