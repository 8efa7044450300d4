"""The link to a force sensor against the simulated one, and records in bulk against one by one."""

import asyncio
import socket
import struct
import sys
import time
from itertools import pairwise

import numpy as np
import pytest
from online_cases import RDT
from rdt_records import RdtRecord, force_sample, read_records
from simulated import flagged, rdt_source, rows, scenario, sensor, timed, until, until_shown
from single_samples import force_block

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online import rdt, udp
from robotrue.online.blocks import Flag
from robotrue.online.rdt import RECORD, arrival_times, decode_records, rdt_block
from robotrue.online.rdt_link import RdtSettings
from robotrue.online.sequence import SequenceState, advance, advance_block, in_order
from robotrue.online.udp import TOLD, tell_arrivals, time_waited
from robotrue.simulation.rdt_sensor import RdtSensor, RdtSensorSettings

SCALE = rdt.RdtScale(newton=1e-6, newton_metre=2e-6)


@pytest.mark.parametrize("seed", range(60))
def test_counts_watched_in_bulk_are_watched_one_by_one(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    state = SequenceState(
        step=int(rng.choice([1, 4])), modulus=int(rng.choice([0, 1000])), window=10, late_after=0.05
    )
    steps = rng.choice([1, 1, 1, 1, 1, 1, 0, -1, 2, 500], size=n) * state.step
    counts = np.cumsum(steps) + int(rng.integers(0, 1000)) + (rng.random(n) < 0.02)
    counts = counts % state.modulus if state.modulus else counts
    times = np.cumsum(
        rng.choice([0.01, 0.01, 0.0, 0.06, -0.01], p=[0.5, 0.2, 0.2, 0.05, 0.05], size=n)
    )
    one, flags = state, []
    for count, when in zip(counts.tolist(), times.tolist(), strict=True):
        one, flag = advance(one, count, when)
        flags.append(int(flag))
    for cut in (n, int(rng.integers(0, n + 1))):  # how it is cut changes nothing
        bulk, head = advance_block(state, counts[:cut], times[:cut])
        bulk, tail = advance_block(bulk, counts[cut:], times[cut:])
        assert bulk == one
        np.testing.assert_array_equal(np.concatenate([head, tail]), flags)


def test_times_in_order():
    latest, flags = in_order(0.5, np.array([1.0, 2.0, 2.0, 1.9, 3.0, 0.0, 0.1, 0.1]), 1.0)
    assert [Flag(int(f)) for f in flags] == [
        Flag.NONE,
        Flag.NONE,
        Flag.REPEATED,
        Flag.REORDERED,
        Flag.NONE,
        Flag.CLOCK_JUMP,
        Flag.NONE,
        Flag.REPEATED,
    ]
    assert latest == 0.1


@pytest.mark.parametrize("device", rdt.RdtDevice)
def test_records_in_bulk_are_records_one_by_one(device):
    rng = np.random.default_rng(7)
    records = np.zeros(300, dtype=RECORD)
    records["rdt"] = 1000 + np.arange(300)
    records["ft"] = 7000 + 7 * np.arange(300)
    records["ft"][rng.random(300) < 0.1] = 7000
    records["ft"][:5] = 7000
    records["rdt"][:3] = 1000
    records["status"] = rng.choice([0, 1 << 16, 1 << 17, 1 << 30, 1 << 27, 1 << 31], size=300)
    counts = rng.integers(-(2**31), 2**31, size=(300, 6))
    counts[rng.random((300, 6)) < 0.05] = 2**31 - 1
    counts[rng.random((300, 6)) < 0.05] = -(2**31)
    records["counts"] = counts // rng.choice([1, 1000], size=(300, 1))
    scale = rdt.RdtScale(newton=1e-4, newton_metre=1e-6)  # some beyond what any sensor gives
    read = decode_records(records.tobytes())
    one, before = [], RdtRecord(rdt_sequence=999, ft_sequence=7000, status=0, counts=(0,) * 6)
    for k in range(0, 300, 30):
        for record in read_records(records[k : k + 30].tobytes()):
            given = Flag.LATE if record.rdt_sequence % 5 == 0 else Flag.NONE
            sample = force_sample(
                record, scale, 0.25, device=device, rate=1e3, before=before, flags=given
            )
            one.append(sample)
            before = record
    bulk = rdt_block(
        read,
        scale,
        np.full(300, 0.25),
        np.where(read["rdt"] % 5 == 0, int(Flag.LATE), 0).astype(np.int64),
        device=device,
        rate=1e3,
        before=(999, 7000),
    )
    expected = force_block(one)
    for name in ("controller_time", "host_time", "wrench", "sequence", "status", "flags"):
        np.testing.assert_array_equal(getattr(bulk, name), getattr(expected, name), err_msg=name)
    assert len(set(bulk.flags.tolist())) > 8


def test_bytes_that_are_no_records():
    assert decode_records(RDT)["rdt"] == [7]
    with pytest.raises(FormatError, match="37 bytes"):
        decode_records(RDT + b"x")


def test_records_read_together_came_one_after_the_other():
    came = arrival_times(np.array([5, 6, 7, 8]), 2.0, 1.9985, 1000.0)
    np.testing.assert_allclose(came, [1.9985, 1.9985, 1.999, 2.0])
    came = arrival_times(np.array([8, 7, 2**32 - 1, 0]), 2.0, 1.0, 1000.0)
    assert (np.diff(came) >= 0.0).all()


def test_what_the_sensor_sends_arrives():
    async def work():
        async with sensor() as there:
            source = rdt_source(there.port)
            found = await until(source, rows(200))
            while there.report.requests < 2:  # start, stop
                await asyncio.sleep(0.001)
            return found, source.health()

    found, health = timed(work())
    count = np.concatenate([b.sequence for b in found])
    np.testing.assert_array_equal(count, np.arange(1, len(count) + 1))
    assert (np.diff(np.concatenate([b.host_time for b in found])) >= 0.0).all()
    assert found[0].frame == "sensor"
    assert (health.received, health.lost, health.refused) == (len(count), 0, 0)
    assert not health.connected  # closed


def test_its_counts_are_what_it_feels():
    settings = RdtSensorSettings(
        port=0, force_noise=0.0, torque_noise=0.0, counts_per_newton=1e5, drift=0.0
    )
    there = RdtSensor(settings, scenario())
    there._socket.close()
    times = np.arange(32_000) / 1e3
    records = there._records(times, 0.0)
    block = rdt_block(
        records, settings.scale, times, np.zeros(32_000, int), device=settings.device, rate=1e3
    )
    felt = scenario().sensor_wrench(times)
    np.testing.assert_allclose(block.wrench, felt, atol=1.1e-5)
    assert block.valid.all()
    assert np.abs(felt[(times > 6.0) & (times < 24.0)]).max() > 50.0  # it cuts
    np.testing.assert_allclose(felt[:900], np.broadcast_to(felt[0], (900, 6)), atol=1e-9)  # rest


def test_what_is_felt_and_its_noise_do_not_depend_on_how_they_are_asked_for():
    settings = RdtSensorSettings(port=0, force_noise=0.2)
    pieces, whole = RdtSensor(settings, scenario()), RdtSensor(settings, scenario())
    times = 3.0 + np.arange(1, 601) / (1e3 * (1.0 + settings.drift))
    cuts = [0, 1, 3, 130, 131, 400, 600]
    found = [pieces._records(times[a:b], 0.0) for a, b in pairwise(cuts)]
    for there in (pieces, whole):
        there._socket.close()
    found, wanted = np.concatenate(found), whole._records(times, 0.0)
    np.testing.assert_array_equal(found["rdt"], wanted["rdt"])
    np.testing.assert_allclose(found["counts"], wanted["counts"], atol=1)


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells on Linux")
def test_records_read_late_came_when_they_came(monkeypatch):
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        other.bind(("127.0.0.1", 0))
        tell_arrivals(other)
        before = time.time_ns()
        one.sendto(b"record", other.getsockname())
        told = other.recvmsg(64, TOLD)[1]
    (stamp,) = (data for _, _, data in told)
    seconds, nanoseconds = struct.unpack("@qq", stamp)
    arrived = 1_000_000_000 * seconds + nanoseconds
    assert before <= arrived <= time.time_ns()
    for late, found in ((0.05, 0.05), (0.9, 0.9), (1.1, 0.0), (-0.01, 0.0)):  # s
        monkeypatch.setattr(udp.time, "time_ns", lambda late=late: arrived + round(1e9 * late))
        assert time_waited(told) == pytest.approx(found, abs=1e-9)


def test_scale_and_rate_from_the_sensors_own_page():
    async def work():
        async with sensor(page_port=0, counts_per_newton=12345.0) as there:
            while there.page_port is None:
                await asyncio.sleep(0)
            page = f"http://127.0.0.1:{there.page_port}/netftapi2.xml"
            source = rdt_source(there.port, scale=None, rate=None, page=page)
            await until(source, rows(20))
            missing = rdt_source(there.port, scale=None, page=page + ".bak")
            reading = asyncio.ensure_future(until(missing, rows(1)))
            while "404" not in missing.health().last_fault:
                await asyncio.sleep(0.01)
            await missing.close()
            assert await reading == []
            return source

    source = timed(work())
    assert source._scale.newton == pytest.approx(1.0 / 12345.0)
    assert source._rate == 1000.0


@pytest.mark.parametrize(
    ("fault", "flag"),
    [
        ("gap@0.1+0.05", Flag.GAP),
        ("repeat@0.1+0.05", Flag.REPEATED),
        ("reorder@0.1+0.1", Flag.REORDERED),
        ("hang@0.1+0.05", Flag.SENSOR_FAULT),
        ("status@0.1+0.05", Flag.SENSOR_FAULT),
        ("saturation@0.1+0.05", Flag.SATURATED),
        ("jump@0.1", Flag.CLOCK_JUMP),
    ],
)
def test_what_goes_wrong_is_said(fault, flag):
    # a busy computer may show two kinds at once; a fault that is over leaves sound samples
    found, source, _ = timed(until_shown(lambda: sensor(fault), rdt_source, flagged(flag, 60)))
    health = source.health()
    flags = np.concatenate([b.flags for b in found])
    valid = np.concatenate([b.valid for b in found])
    assert valid[-50:].all()
    if flag in Flag.INVALID:
        assert not valid[(flags & int(flag)) != 0].any()
    if flag is Flag.GAP:
        assert health.lost > 0
    if flag in Flag.SENSOR_FAULT | Flag.SATURATED:
        assert "record" in health.last_fault


def test_what_are_no_records_is_refused_and_counted():
    found, source, _ = timed(
        until_shown(lambda: sensor("garble@0.1+0.1"), rdt_source, flagged(Flag.GAP, 20))
    )
    assert source.health().refused > 0
    assert all(b.valid.all() for b in found[-2:])


def test_a_sensor_that_was_gone_is_asked_again():
    found, source, there = timed(
        until_shown(lambda: sensor("silence@0.2+0.5"), rdt_source, flagged(Flag.CLOCK_JUMP, 50))
    )
    health, requests = source.health(), there.report.requests
    count = np.concatenate([b.sequence for b in found])
    assert health.reconnects == 1
    assert "silent" in health.last_fault
    assert (np.diff(count) < 0).sum() == 1  # it numbers its records anew
    assert requests >= 2


def test_a_sensor_killed_and_started_again():
    async def work():
        async with sensor() as first:
            port = first.port
            source = rdt_source(port)
            stream = source.blocks()
            await anext(stream)
        async with sensor(port=port):
            found = []
            async for block in stream:
                found.append(block)
                if flagged(Flag.CLOCK_JUMP, 20)(found):
                    break
            await stream.aclose()
        return source.health()

    assert timed(work()).reconnects == 1


def test_nobody_there():
    async def work():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            port = taken.getsockname()[1]
        source = rdt_source(port)
        reading = asyncio.ensure_future(until(source, rows(1)))
        while not source.health().last_fault:
            await asyncio.sleep(0.01)
        assert not source.health().connected
        await source.close()
        return await reading

    assert timed(work()) == []


def test_a_wrong_rate_is_refused():
    async def work():
        async with sensor() as there:
            await until(rdt_source(there.port, rate=7000.0), rows(100_000))

    with pytest.raises(ConfigurationError, match=r"sends about \d+ records per second, 7000 are"):
        timed(work())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rate": 7e3}, "counts are never used as newtons"),
        ({"scale": SCALE}, "records per second are not stated"),
        ({"page": "file:///netftapi2.xml", "rate": 7e3}, "expected http://SENSOR"),
        ({"scale": SCALE, "rate": 7e3, "gather": 1.0}, "gather 1 s"),
    ],
)
def test_settings_that_would_not_do(settings, message):
    with pytest.raises(ConfigurationError, match=message):
        RdtSettings(name="rdt://x", host="x", **settings)
