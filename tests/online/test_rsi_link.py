"""The link to a KUKA controller over real sockets: sound packets, bad ones, a simulated robot."""

import asyncio
import time
from dataclasses import replace

import numpy as np
import pytest
from online_cases import flipped
from robots import Robot, collected, ipoc_of, rob, until
from rsi_samples import write_rsi_config

from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Flag
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.robot_link import Turnaround
from robotrue.online.rsi_answer import SenWriter
from robotrue.online.rsi_config import parse_rsi_config, usual_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource
from robotrue.robot.presets import preset
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.rsi_controller import RsiController, RsiControllerSettings

ABSOLUTE, RELATIVE = CorrectionMode.ABSOLUTE, CorrectionMode.RELATIVE
START = 4_208_163_634


def _settings(config=None, **changes):
    config = usual_rsi_config("127.0.0.1", 49152) if config is None else config
    given = {"name": "rsi://test", "config": config, "cycle_ms": 4, "host": "127.0.0.1", "port": 0}
    return RsiSettings(**(given | changes))


def _session(play, corrector=None, **changes):
    """Plays against a source in a thread, and returns its health and what it gave after."""

    async def session():
        source = RsiSource(_settings(**changes), corrector)
        with Robot(source.address) as robot:
            await asyncio.wait_for(asyncio.to_thread(play, robot, source), 30.0)
            await source.close()
            # an answer goes out before its packet is counted
            health = source.health()
        blocks = [block async for block in source.blocks()]
        return health, blocks

    health, blocks = asyncio.run(session())
    flags = [Flag(int(f)) for block in blocks for f in block.flags]
    sequence = [int(s) for block in blocks for s in block.sequence]
    return health, dict(zip(sequence, flags, strict=False)), blocks


def test_it_answers_every_packet_with_its_ipoc_and_gives_the_samples():
    answers = []

    def play(robot, source):
        answers.extend(robot.ask(rob(START + 4 * k)) for k in range(20))
        until(lambda: source.health().connected)

    health, flags, blocks = _session(play)
    assert [ipoc_of(a) for a in answers] == [START + 4 * k for k in range(20)]
    assert all(b'<RKorr X="0.000000"' in a for a in answers)
    assert (health.received, health.lost, health.refused) == (20, 0, 0)
    assert 0.0 < health.turnaround_p50 <= health.turnaround_p99 < 1.0
    assert all(not f & Flag.INVALID for f in flags.values())
    joints = np.concatenate([b.joints for b in blocks])
    np.testing.assert_allclose(joints[:, 0], 10.0 * DEG)
    assert (np.diff(np.concatenate([b.host_time for b in blocks])) >= 0.0).all()


BAD = {
    "no IPOC": rob(START + 4).replace(b"<IPOC>4208163638</IPOC>", b""),
    "two of them": rob(START + 4).replace(b"</Rob>", b"<IPOC>9</IPOC></Rob>"),
    "cut short": rob(START + 4)[:-20],
    "no XML": b"\x00\xff" * 40,
    "empty": b"",
    "another root": rob(START + 4).replace(b"Rob", b"Sen"),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_what_cannot_be_read_is_refused_and_not_answered(bad):
    def play(robot, source):
        robot.ask(rob(START))
        robot.send(bad)
        until(lambda: source.health().refused == 1)
        assert robot.quiet()
        assert source.health().last_fault
        assert ipoc_of(robot.ask(rob(START + 4))) == START + 4

    health, flags, _ = _session(play)
    assert (health.received, health.refused) == (2, 1)
    assert list(flags) == [START, START + 4]


def test_a_packet_that_is_not_as_configured_begins_no_session():
    config = usual_rsi_config("127.0.0.1", 49152)

    def play(robot, source):
        robot.send(rob(START).replace(b'<Delay D="0" />', b""))
        until(lambda: source.health().refused == 1)
        assert robot.quiet()
        assert "without Delay" in source.health().last_fault
        assert not source.health().connected

    _session(play, config=config)


def test_nan_is_answered_flagged_and_ends_the_correction():
    guard = _guard(ABSOLUTE)

    def play(robot, source):
        now = _led(robot, guard, 30)
        robot.ask(rob(now, a1="nan"))
        until(lambda: not guard.state().active)
        assert "NOT_FINITE" in guard.state().why
        until(lambda: "NOT_FINITE" in source.health().last_fault)

    _, flags, blocks = _session(play, guard, mode=ABSOLUTE)
    last = list(flags.values())[-1]
    assert last & Flag.NOT_FINITE
    assert np.isnan(blocks[-1].joints[-1, 0])


def test_repeated_reordered_and_lost_packets_and_clocks_that_jump():
    def play(robot, source):
        robot.ask(rob(START))
        robot.ask(rob(START + 4))
        robot.send(rob(START + 4))
        until(lambda: source.health().received == 3)
        assert robot.quiet(), "a packet is answered once"
        robot.ask(rob(START + 20))
        assert ipoc_of(robot.ask(rob(START + 16))) == START + 16
        robot.ask(rob(START + 24))
        robot.ask(rob(START + 24 + 60_000))
        robot.ask(rob(START + 28 + 60_000))
        robot.ask(rob(START + 31 + 60_000))

    health, _, blocks = _session(play)
    kinds = [Flag(int(f)) & (Flag.INVALID | Flag.GAP) for b in blocks for f in b.flags]
    none = Flag.NONE
    expected = [none, none, Flag.REPEATED, Flag.GAP, Flag.REORDERED, none]
    assert kinds == [*expected, Flag.CLOCK_JUMP, none, Flag.CLOCK_JUMP]
    assert health.lost == 2
    assert "CLOCK_JUMP" in health.last_fault


def test_a_wrong_ipoc_does_not_silence_the_link():
    """One that lies ahead makes those after it look old; they are answered all the same."""

    def play(robot, source):
        for ipoc in (START, START + 4, START + 60, START + 8, START + 12, START + 16):
            assert ipoc_of(robot.ask(rob(ipoc))) == ipoc

    _, flags, _ = _session(play)
    assert flags[START + 60] & Flag.GAP
    assert flags[START + 8] & Flag.REORDERED


def test_a_second_sender_is_refused_and_the_first_kept():
    def play(robot, source):
        robot.ask(rob(START))
        with Robot(source.address) as other:
            # the first is heard often enough to be there still
            for k in range(1, 6):
                robot.ask(rob(START + 4 * k))
                other.send(rob(1000 + 4 * k))
            until(lambda: source.health().refused == 5)
            assert other.quiet()
        assert "a second sender" in source.health().last_fault

    health, flags, _ = _session(play)
    assert min(flags) == START
    assert health.reconnects == 0


@pytest.mark.parametrize(("mode", "answered"), [(ABSOLUTE, False), (RELATIVE, True)])
def test_a_controller_that_comes_back_is_not_moved(mode, answered):
    """Another port and another clock: it holds what it held, or nothing; no answer suits both."""
    guard = _guard(mode)

    def play(robot, source):
        _led(robot, guard, 30)
        assert not guard.state().at_rest
        until(lambda: not source.health().connected)
        with Robot(source.address) as again:
            for ipoc in (17, 21):
                again.send(rob(ipoc))
                if answered:
                    assert b'X="0.000000"' in again.socket.recv(65535)
                else:
                    assert again.quiet()
            until(lambda: source.health().received == 32)
            assert "may have restarted or still apply 0." in guard.state().why
            guard.rearm()
            assert not guard.state().active

    config = DROP if mode is RELATIVE else HOLD
    health, flags, _ = _session(play, guard, mode=mode, config=config)
    assert health.reconnects == 1
    assert flags[17] & Flag.CLOCK_JUMP
    assert not flags[21] & Flag.INVALID


def test_answers_that_were_late_bite():
    guard = _guard(RELATIVE)

    def play(robot, source):
        now = _led(robot, guard, 30)
        robot.ask(rob(now, late=1))
        robot.ask(rob(now + 4, late=1))
        assert guard.state().active
        robot.ask(rob(now + 8, late=2))
        until(lambda: not guard.state().active)

    health, flags, _ = _session(
        play, guard, mode=RELATIVE, config=usual_rsi_config("127.0.0.1", 49152, hold=False)
    )
    assert "2 late answers" in guard.state().why
    assert sum(bool(f & Flag.LATE) for f in flags.values()) >= 2
    assert health.late >= 2


def test_only_send_is_not_answered():
    config = replace(usual_rsi_config("127.0.0.1", 49152), only_send=True)

    def play(robot, source):
        for k in range(3):
            robot.send(rob(START + 4 * k))
        until(lambda: source.health().received == 3)
        assert robot.quiet()

    health, _, _ = _session(play, config=config)
    assert np.isnan(health.turnaround_p50)


def test_a_slow_reader_is_named_and_loses_nothing():
    def play(robot, source):
        for k in range(12):
            robot.ask(rob(START + 4 * k))
        until(lambda: source.health().received == 12)
        assert source.health().last_fault == "12 samples wait to be read, more than 10"

    _, flags, _ = _session(play, waiting=10)
    assert len(flags) == 12


def test_the_time_of_a_packet_is_that_of_its_arrival():
    """As the system tells it, not when the thread got to it; and never before the one before."""

    def play(robot, source):
        before = time.monotonic()
        robot.ask(rob(START))
        times.append((before, time.monotonic()))

    times = []
    _, _, blocks = _session(play)
    ((before, after),) = times
    assert before - 1e-3 <= blocks[0].host_time[0] <= after


def test_no_flipped_bit_ends_the_link():
    async def session():
        source = RsiSource(_settings(mode=ABSOLUTE), _guard(ABSOLUTE))
        with Robot(source.address) as robot:
            await asyncio.to_thread(robot.ask, rob(START))
            for k, data in enumerate(flipped(rob(START + 4))):
                if k % 5 == 0:
                    robot.send(data)
                if k % 200 == 0:
                    # what waits is not more than the system holds
                    await asyncio.to_thread(robot.ask, rob(START + 4 + k))
            answer = await asyncio.to_thread(robot.ask, rob(START + 400_000))
            while ipoc_of(answer) != START + 400_000:
                answer = await asyncio.to_thread(robot.socket.recv, 65535)
            await source.close()
        return source.health(), [block async for block in source.blocks()]

    health, blocks = asyncio.run(session())
    assert health.refused > 100
    assert blocks[-1].sequence[-1] == START + 400_000
    valid = np.concatenate([b.joints[b.valid] for b in blocks])
    assert len(valid) > 0
    assert np.isfinite(valid).all()


def test_an_address_that_is_taken():
    async def twice():
        source = RsiSource(_settings())
        try:
            with pytest.raises(ConfigurationError, match="cannot be listened on"):
                RsiSource(_settings(port=source.address[1]))
        finally:
            await source.close()

    asyncio.run(twice())


HOLD = usual_rsi_config("127.0.0.1", 49152)
DROP = usual_rsi_config("127.0.0.1", 49152, hold=False)


@pytest.mark.parametrize(
    ("config", "mode", "message"),
    [
        (HOLD, None, "not stated whether the controller adds them up"),
        (HOLD, RELATIVE, r'RKorr.X has HOLDON="1" with relative .* would move on'),
        (DROP, ABSOLUTE, r'RKorr.X has HOLDON="0" with absolute .* would jump back'),
        (replace(HOLD, only_send=True), ABSOLUTE, "ONLYSEND"),
        (replace(HOLD, send=HOLD.send[:2]), ABSOLUTE, "late answers"),
        (replace(HOLD, receive=HOLD.receive[1:]), ABSOLUTE, "takes no RKorr.X"),
    ],
)
def test_corrections_that_cannot_be_sent_safely_are_refused(config, mode, message):
    with pytest.raises(ConfigurationError, match=message):
        RsiSource(_settings(config=config, mode=mode), _guard(ABSOLUTE))


def test_answers_to_the_byte():
    wanted = Correction(shift=np.array([1e-4, -2.5e-10, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)
    two = replace(HOLD, receive=HOLD.receive[:2], sen_type="a&b%")
    assert SenWriter(two, ABSOLUTE).write(77, wanted) == (
        b'<Sen Type="a&amp;b%"><RKorr X="0.100000" Y="-0.000000" /><IPOC>77</IPOC></Sen>'
    )
    turned = replace(wanted, turn=np.full(3, 1e-3))
    assert SenWriter(HOLD, ABSOLUTE).write(77, turned) == (
        b'<Sen Type="ImFree"><RKorr X="0.100000" Y="-0.000000" Z="0.000000" A="0.057324" '
        b'B="0.057267" C="0.057324" /><IPOC>77</IPOC></Sen>'
    )


def test_a_configuration_written_is_the_one_read():
    for config in (HOLD, DROP, replace(HOLD, only_send=True, sen_type="a<b")):
        assert parse_rsi_config(write_rsi_config(config)) == config


def test_the_histogram_of_turnarounds():
    times = np.random.default_rng(3).lognormal(np.log(2e-4), 0.7, 5000)
    turnaround = Turnaround()
    assert np.isnan(turnaround.quantile(0.5))
    for value in times:
        turnaround.add(value)
    for share in (0.5, 0.99, 1.0):
        assert turnaround.quantile(share) == pytest.approx(np.quantile(times, share), rel=0.05)
    assert turnaround.largest == times.max()


def _guard(mode, **changes):
    given = {"shift": 0.5 * MM, "shift_rate": 20.0 * MM, "cycle": 4e-3, "ramp": 0.05}
    return CorrectionGuard(CorrectionLimits(**(given | {"timeout": 5.0} | changes)), mode)


def _led(robot, guard, cycles):
    """A robot that is led by 0.2 mm; returns the next IPOC."""
    wanted = Correction(shift=np.array([0.2 * MM, 0.0, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)
    for k in range(cycles):
        guard.want(wanted, time.monotonic())
        robot.ask(rob(START + 4 * k))
    return START + 4 * cycles


def _jog():
    return Jog(robot=preset("kr160"), joints=np.array([0.0, 30.0, -30.0, 0.0, 60.0, 0.0]) * DEG)


@pytest.mark.parametrize(("mode", "config"), [(ABSOLUTE, HOLD), (RELATIVE, DROP)])
def test_a_simulated_robot_is_led_within_limits_and_left_without_correction(mode, config):
    guard = _guard(mode, late_answers=1000)
    shift = np.array([0.2 * MM, -0.1 * MM, 0.0])

    async def session():
        source = RsiSource(_settings(config=config, mode=mode), guard)
        target = replace(config, port=source.address[1])
        stop = asyncio.Event()
        robot = asyncio.create_task(
            RsiController(
                RsiControllerSettings(
                    config=target, mode=mode, motion=_jog(), timeout_packets=100_000
                )
            ).run(stop=stop)
        )
        wanted = Correction(shift=shift, turn=np.zeros(3), mode=ABSOLUTE)
        began = time.monotonic()
        async for block in source.blocks():
            if not guard.state().active:
                guard.rearm()  # a machine that sleeps for long is a fault, too
            guard.want(wanted, float(block.host_time[-1]))
            if np.abs(guard.state().held.shift - shift).max() < 2e-9:
                break
            assert time.monotonic() < began + 20.0
        await asyncio.wait_for(source.close(), 15.0)
        stop.set()
        return await asyncio.wait_for(robot, 15.0)

    report = asyncio.run(session())
    assert not report.broke_off
    assert report.faulty == 0
    # one answer more or less may have been late when it was reached
    assert report.largest_mm == pytest.approx(np.hypot(0.2, 0.1), abs=1e-4 + 0.08 * report.late)
    assert report.largest_step_mm <= 20.0 * 4e-3 * (1 + report.late) + 1e-9
    np.testing.assert_allclose(report.correction, 0.0, atol=1e-9)


def test_the_simulated_robot_judges_as_a_controller_does():
    settings = RsiControllerSettings(
        config=DROP, mode=RELATIVE, motion=_jog(), timeout_packets=2, first_ipoc=START
    )
    robot = RsiController(settings)

    def cycle(*answers):
        robot.next_packet()
        for answer in answers:
            robot.take(answer)
        robot.close_cycle()
        return robot.report

    def sen(ipoc, x=0.0):
        wanted = Correction(shift=np.array([x, 0.0, 0.0]), turn=np.zeros(3), mode=RELATIVE)
        return SenWriter(DROP, RELATIVE).write(ipoc, wanted)

    assert cycle().late == 0, "nobody has answered yet"
    assert cycle(sen(START + 4, 1e-3)).answered == 1
    assert cycle(sen(START + 8, 1e-3)).correction[0] == pytest.approx(2.0)
    report = cycle()
    assert (report.late, report.correction[0]) == (1, pytest.approx(2.0))
    report = cycle(sen(START + 12), sen(START + 16, 1e-3))
    assert (report.late, report.faulty, report.answered) == (1, 0, 3), "the late one is counted"
    report = cycle(sen(START + 999))
    assert (report.late, report.faulty, report.broke_off) == (1, 1, "")
    assert "1 late and 2 faulty answers" in cycle(b"<Sen/>").broke_off
    assert robot.next_packet() is None


def test_a_late_answer_to_a_cycle_that_was_cut_short_is_told_apart():
    robot = RsiController(RsiControllerSettings(config=HOLD, mode=ABSOLUTE, motion=_jog()))
    for short in (None, False, True, True):
        robot.next_packet()
        if short is None:
            rest = Correction(shift=np.zeros(3), turn=np.zeros(3), mode=ABSOLUTE)
            robot.take(SenWriter(HOLD, ABSOLUTE).write(robot.settings.first_ipoc, rest))
        robot.close_cycle(short=bool(short))
    assert (robot.report.answered, robot.report.late, robot.report.overslept) == (1, 3, 2)


def test_the_simulated_robot_holds_or_drops_and_limits():
    held = RsiController(RsiControllerSettings(config=HOLD, mode=ABSOLUTE, motion=_jog()))
    first = held.settings.first_ipoc
    for k in range(2):
        held.next_packet()
        if k == 0:
            wanted = Correction(shift=np.array([1e-3, 0, 0]), turn=np.zeros(3), mode=ABSOLUTE)
            held.take(SenWriter(HOLD, ABSOLUTE).write(first, wanted))
        held.close_cycle()
    assert held.report.correction[0] == pytest.approx(1.0)
    held.next_packet()
    wanted = Correction(shift=np.array([0, 6e-3, 0]), turn=np.zeros(3), mode=ABSOLUTE)
    held.take(SenWriter(HOLD, ABSOLUTE).write(first + 8, wanted))
    held.close_cycle()
    assert held.report.broke_off == "correction Y of 6.000000 is beyond 5"


def test_collected_blocks_hold_every_row():
    """Reading block by block while the robot runs loses none."""

    async def session():
        source = RsiSource(_settings())
        target = usual_rsi_config("127.0.0.1", source.address[1])
        settings = RsiControllerSettings(config=target, mode=ABSOLUTE, motion=_jog(), cycles=60)
        robot = asyncio.create_task(RsiController(settings).run())
        blocks = await collected(source, 60)
        report = await robot
        await source.close()
        return blocks, report

    blocks, report = asyncio.run(session())
    sequence = np.concatenate([b.sequence for b in blocks])
    np.testing.assert_array_equal(np.diff(sequence), 4)
    assert report.cycles == 60
