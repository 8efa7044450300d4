"""Lines that are whole, whatever happens to the process or the disk."""

import asyncio
import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from estimate_cases import estimates

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online import csv_streams
from robotrue.online.estimates import Doubt
from robotrue.online.sinks import SinkSettings, open_sink


def _written(address, *blocks, settings=None):
    async def run():
        sink = open_sink(address, settings)
        await sink.open()
        for block in blocks:
            await sink.write(block)
        await sink.close()
        return sink

    return asyncio.run(run())


def test_numbers_come_back(tmp_path):
    path = tmp_path / "out.csv"
    doubt = np.array([0, int(Doubt.EXTRAPOLATED), int(Doubt.BAD_FORCE | Doubt.SETTLING), 0])
    block = estimates(0, 4, doubt=doubt)
    sink = _written(f"csv:{path}", block)
    table = pd.read_csv(path)
    assert list(table.columns[:8]) == [
        "host_s", "sequence", "ex_um", "ey_um", "ez_um", "sd_x_um", "sd_y_um", "sd_z_um",
    ]  # fmt: skip
    assert list(table["doubt"]) == ["none", "extrapolated", "bad_force+settling", "none"]
    assert np.isnan(table.loc[2, "ex_um":"static_z_um"].to_numpy(dtype=float)).all()
    np.testing.assert_allclose(table[["ex_um", "ey_um", "ez_um"]], block.error * 1e6, atol=6e-5)
    np.testing.assert_allclose(table["host_s"], block.host_time, atol=1e-9)
    np.testing.assert_allclose(table["a6_deg"], np.degrees(0.6), atol=1e-4)
    assert sink.health().received == 1
    assert sink.health().connected is False


def test_no_file_is_written_over(tmp_path):
    path = tmp_path / "out.csv"
    path.write_bytes(b"mine\n")
    with pytest.raises(ConfigurationError, match="csv\\+append:") as refused:
        _written(f"csv:{path}", estimates(0, 1))
    assert "5 bytes" in str(refused.value)
    with pytest.raises(FormatError, match="expected the columns"):
        _written(f"csv+append:{path}", estimates(0, 1))
    assert path.read_bytes() == b"mine\n"


@pytest.mark.parametrize("joints", [6, 7])
def test_goes_on_after_a_cut_anywhere(tmp_path, joints):
    path = tmp_path / "out.csv"
    settings = SinkSettings(joints=joints)
    _written(f"csv:{path}", estimates(0, 3, dof=joints), settings=settings)
    whole = path.read_bytes()
    ends = [k for k, byte in enumerate(whole) if byte == 10]
    near = {k + d for k in ends for d in (-1, 0, 1)}
    for cut in sorted({*range(0, len(whole), 23), *near}):
        path.write_bytes(whole[:cut])
        sink = _written(f"csv+append:{path}", estimates(3, 1, dof=joints), settings=settings)
        lines = path.read_bytes().splitlines(keepends=True)
        kept = max(1, whole[:cut].count(b"\n"))
        assert lines[:kept] == whole.splitlines(keepends=True)[:kept]
        assert len(lines) == kept + 1
        assert all(line.endswith(b"\n") and line.count(b",") == 17 + joints for line in lines)
        assert (sink.resumed_after is None) == (kept == 1)


def test_a_file_of_another_arm_is_not_gone_on_with(tmp_path):
    path = tmp_path / "out.csv"
    _written(f"csv:{path}", estimates(0, 1))
    with pytest.raises(FormatError, match="another name"):
        _written(f"csv+append:{path}", settings=SinkSettings(joints=7))


def test_estimates_of_another_arm_are_counted_and_left_out(tmp_path):
    path = tmp_path / "out.csv"
    sink = _written(f"csv:{path}", estimates(0, 1), estimates(1, 1, dof=7), estimates(2, 1, dof=0))
    health = sink.health()
    assert (health.received, health.refused) == (2, 1)
    assert "7 joints" in health.last_fault
    assert len(path.read_bytes().splitlines()) == 3


def test_a_full_disk_costs_whole_blocks(tmp_path, monkeypatch):
    room = 4000

    class Full(io.FileIO):
        def write(self, data):
            left = room - self.seek(0, os.SEEK_END)
            if left <= 0:
                raise OSError(28, "No space left on device")
            return super().write(data[:left])

    monkeypatch.setattr(csv_streams, "FileIO", Full)
    path = tmp_path / "out.csv"
    sink = _written(f"csv:{path}", *(estimates(5 * k, 5) for k in range(8)))
    data = path.read_bytes()
    health = sink.health()
    assert health.received > 0
    assert health.refused == 8 - health.received
    assert "No space left" in health.last_fault
    assert data.endswith(b"\n")
    assert data.count(b"\n") == 1 + 5 * health.received


_WRITER = """
import asyncio, sys
sys.path.insert(0, {folder!r})
from estimate_cases import estimates
from robotrue.online.sinks import open_sink
async def run():
    sink = open_sink("csv+append:" + {path!r})
    await sink.open()
    for k in range(1_000_000):
        await sink.write(estimates(50 * k, 50))
        sys.stdout.write(f"{{50 * k + 50}}\\n")
        sys.stdout.flush()
asyncio.run(run())
"""


def test_killed_at_any_moment(tmp_path):
    path = tmp_path / "out.csv"
    code = _WRITER.format(folder=str(Path(__file__).parent), path=str(path))
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
    )
    try:
        said = 0
        while said < 2000:
            said = int(process.stdout.readline())
    finally:
        process.send_signal(signal.SIGKILL)
        said = max([said, *(int(word) for word in process.stdout.read().split("\n")[:-1])])
        process.wait(timeout=10)
        process.stdout.close()
    data = path.read_bytes()
    lines = data[: data.rfind(b"\n") + 1].splitlines()
    assert len(lines) - 1 >= said
    assert len({line.count(b",") for line in lines}) == 1
    assert [int(line.split(b",")[1]) for line in lines[1:]] == list(range(len(lines) - 1))
    _written(f"csv+append:{path}", estimates(len(lines) - 1, 1))
    table = pd.read_csv(path)
    assert list(table["sequence"]) == list(range(len(lines)))


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("kafka://host", "sink 'kafka:', expected one of csv:"),
        ("out.csv", "sink 'out.csv', expected one of csv:"),
        ("csv:", "without a path"),
    ],
)
def test_addresses_that_are_none(address, words):
    with pytest.raises(ConfigurationError, match=words):
        open_sink(address)


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FormatError, match="cannot write"):
        _written(f"csv:{tmp_path / 'none' / 'out.csv'}")


@pytest.mark.parametrize("cell", ["", "a b", "a/b", "a+", "a#", "a\x00"])
def test_names_of_cells_that_no_topic_can_hold(cell):
    with pytest.raises(ConfigurationError, match="cell name"):
        SinkSettings(cell=cell)
