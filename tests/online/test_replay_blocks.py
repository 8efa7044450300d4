"""Recorded streams in blocks: the samples and flags of the reader of lines, whatever the file."""

import asyncio
import itertools

import numpy as np
import pytest
from line_replay import replay_force, replay_joints
from single_samples import force_block, joint_block

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online import replay_columns
from robotrue.online.blocks import Flag
from robotrue.online.replay_blocks import Repeats, force_blocks, joint_blocks
from robotrue.online.replay_link import ReplayForce, ReplayJoints, ReplaySettings

ODD_NUMBERS = ["nan", "", "1e9", " 2.5", "-0", ".5", "5.", "+1e-3", "NaN", "1_0", "inf"]
ODD_LINES = ["# a remark", "", "1,2", "x", "\r", "1e,2,3", "--1"]
SEEDS = range(60)


def _record(rng, columns, counted):
    """Lines of a record whose clock goes on, most of the time."""
    lines, time, count = [], 5.0, 100
    plain = rng.random() < 0.3
    for _ in range(rng.integers(1, 25)):
        time += rng.choice([0.004, 0.004, 0.004, 0.0, -0.004, 2.0, -3.0])
        count += rng.choice([1, 1, 1, 1, 0, -1, 3, 5000])
        cells = [f"{time:.4f}" if rng.random() < 0.9 else rng.choice(["", "nan"])]
        cells += [str(max(count, 0))] if counted else []
        for number in rng.normal(scale=300.0, size=columns):
            odd = not plain and rng.random() < 0.1
            cells.append(rng.choice(ODD_NUMBERS) if odd else repr(float(number)))
        lines.append(",".join(cells))
        if rng.random() < 0.02:
            lines.append(rng.choice(ODD_LINES))
    return rng.choice(["\n", "\r\n"]).join(lines) + rng.choice(["\n", "\n", ""])


def _all(samples):
    """What came before a fault, and the fault."""
    found = []
    try:
        found.extend(samples)
    except RobotrueError as fault:
        return found, str(fault)
    return found, ""


def _same(blocks, samples, joined):
    blocks, fault = _all(blocks)
    samples, expected = _all(samples)
    assert fault == expected
    assert sum(map(len, blocks)) == len(samples)
    if not samples:
        return
    whole = joined(samples)
    for name in whole.__dataclass_fields__:
        if name == "frame":
            continue
        got = np.concatenate([getattr(block, name) for block in blocks])
        np.testing.assert_array_equal(got, getattr(whole, name), err_msg=name)


FORCE_HEADS = {
    (3, False): "t_s,fx_N,fy_N,fz_N",
    (7, False): "t_s,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm,status",
    (4, True): "t_s,sequence,fx_N,fy_N,fz_N,host_s",
}


@pytest.mark.parametrize("kind", FORCE_HEADS)
@pytest.mark.parametrize("chunk", [40, 1 << 20])
def test_force_in_blocks_is_force_line_by_line(kind, chunk, tmp_path, monkeypatch):
    monkeypatch.setattr(replay_columns.read_columns, "__kwdefaults__", {"chunk": chunk})
    path = tmp_path / "force.csv"
    for seed in SEEDS:
        text = _record(np.random.default_rng([seed, 1]), *kind)
        text = text.replace(",inf", ",7") if kind[1] else text  # no clock shows infinity
        path.write_bytes((FORCE_HEADS[kind] + "\n" + text).encode())
        _same(force_blocks(path), replay_force(path), force_block)


@pytest.mark.parametrize("columns", [6, 12])
def test_joints_in_blocks_are_joints_line_by_line(columns, tmp_path):
    path = tmp_path / "joints.csv"
    head = "t_s,sequence," + ",".join(f"a{k}_deg" for k in range(1, 7))
    head += ",x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg" if columns == 12 else ""
    for seed in SEEDS:
        text = _record(np.random.default_rng([seed, 2]), columns, True)
        path.write_bytes((head + "\n" + text).encode())
        _same(joint_blocks(path), replay_joints(path), joint_block)


def test_nothing_but_numbers_is_read_at_once(tmp_path, monkeypatch):
    """Or the short way would have been lost without a word."""
    path = tmp_path / "force.csv"
    rows = "".join(f"{k * 1e-3},1.5,,nan\r\n" for k in range(1000))
    path.write_bytes(b"\xef\xbb\xbft_s,fx_N,fy_N,fz_N\r\n" + rows.encode())

    def refuse(*_):
        raise AssertionError("line by line")

    monkeypatch.setattr(replay_columns, "_by_line", refuse)
    assert sum(map(len, force_blocks(path))) == 1000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("t_s,fx_N,fy_N,fz_N\n", "no rows"),
        ("t_s,fx_N,fy_N\n0,1,2\n", "missing fz_N"),
        ("t_s,fx_N,fy_N,fz_N\n0,1,2,3\n0,1,2\n", "csv:3: 3 cells"),
        ("t_s,sequence,fx_N,fy_N,fz_N\n0,1.5,1,2,3\n", r"csv:2: sequence 1\.5"),
    ],
)
def test_files_that_cannot_be_played(text, message, tmp_path):
    path = tmp_path / "force.csv"
    path.write_text(text)
    with pytest.raises(RobotrueError, match=message):
        list(force_blocks(path))


def _clean(tmp_path, rows, counted):
    path = tmp_path / "force.csv"
    head = "t_s,host_s,sequence,fx_N,fy_N,fz_N\n" if counted else "t_s,fx_N,fy_N,fz_N\n"
    with path.open("w") as stream:
        stream.write(head)
        for k in range(rows):
            clock = f"{k * 1e-3:.6f}"
            stream.write(clock + (f",{100 + k * 1e-3:.6f},{k + 7}" if counted else "") + ",1,2,3\n")
    return path


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize("kept", [True, False])
def test_a_record_repeated_goes_on_without_a_seam(counted, kept, tmp_path, monkeypatch):
    if not kept:
        monkeypatch.setattr("robotrue.online.replay_blocks._KEPT", 0)
    path = _clean(tmp_path, 500, counted)
    blocks = list(force_blocks(path, Repeats(times=3)))
    time = np.concatenate([b.controller_time for b in blocks])
    sequence = np.concatenate([b.sequence for b in blocks])
    assert len(time) == 1500
    assert not np.concatenate([b.flags for b in blocks]).any()
    np.testing.assert_allclose(np.diff(time), 1e-3, atol=1e-9)
    assert (np.diff(sequence) == 1).all()


def test_two_records_with_one_period_stay_together(tmp_path):
    path = _clean(tmp_path, 500, True)
    blocks = list(itertools.islice(force_blocks(path, Repeats(times=None, period=0.75)), 4))
    starts = [block.host_time[0] for block in blocks]
    np.testing.assert_allclose(np.diff(starts), 0.75, atol=1e-12)
    with pytest.raises(ConfigurationError, match=r"0\.4 s for a record of 0\.499 s"):
        list(force_blocks(path, Repeats(times=2, period=0.4)))


def _collected(source):
    async def collect():
        return [block async for block in source.blocks()]

    return asyncio.run(asyncio.wait_for(collect(), 20.0))


def test_a_replay_goes_on_where_it_ended(tmp_path):
    path = tmp_path / "force.csv"
    counts = [1, 2, 3, 3, 2, 9, 10, 11, 5000, 5001, 5001, 5002]
    path.write_text(
        "t_s,sequence,fx_N,fy_N,fz_N\n" + "".join(f"{k},{c},1,2,3\n" for k, c in enumerate(counts))
    )
    options = {"name": "replay", "path": path, "repeats": Repeats(times=2)}
    whole = _collected(ReplayForce(ReplaySettings(**options)))
    sequence = np.concatenate([b.sequence for b in whole])
    flags = np.concatenate([b.flags for b in whole])
    assert flags[3] == Flag.REPEATED
    for start in range(2 * len(counts) + 1):
        source = ReplayForce(ReplaySettings(**options, start=start, rows=5))
        rest = _collected(source)
        assert source.health().received == len(flags) - start
        assert all(len(b) <= 5 for b in rest)
        got = np.concatenate([b.flags for b in rest]) if rest else np.empty(0)
        np.testing.assert_array_equal(got, flags[start:])
        got = np.concatenate([b.sequence for b in rest]) if rest else np.empty(0)
        np.testing.assert_array_equal(got, sequence[start:])


def test_in_time(tmp_path):
    """At ten times its speed 0.5 s take 50 ms or more, and nothing comes before its time."""
    path = _clean(tmp_path, 500, False)

    async def play():
        loop = asyncio.get_running_loop()
        begun, ahead = loop.time(), -1.0
        source = ReplayForce(ReplaySettings(name="replay", path=path, speed=10.0))
        async for block in source.blocks():
            ahead = max(ahead, float(block.host_time[-1]) - 10.0 * (loop.time() - begun))
        return loop.time() - begun, ahead, source.health()

    took, ahead, health = asyncio.run(asyncio.wait_for(play(), 20.0))
    assert took >= 0.049
    assert ahead <= 0.0
    assert (health.received, health.connected) == (500, False)


def test_closed(tmp_path):
    path = tmp_path / "joints.csv"
    row = ",1,2,3,4,5,6\n"
    head = "t_s," + ",".join(f"a{k}_deg" for k in range(1, 7)) + "\n"
    path.write_text(head + "".join(f"{k}{row}" for k in range(100)))

    async def play():
        source = ReplayJoints(ReplaySettings(name="replay", path=path, rows=10))
        taken = 0
        async for block in source.blocks():
            taken += len(block)
            if taken == 30:
                await source.close()
        return taken

    assert asyncio.run(play()) == 30
