"""The link to an ABB controller over real sockets, both generations, and a simulated robot."""

import asyncio
import time
from dataclasses import replace

import numpy as np
import pytest
from online_cases import EGM_BARE, EGM_JOINT_TARGET, EGM_SEVEN, EGM_SIX, FORCE, JOINTS
from robots import Robot, milling_force, until

from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.online import egm
from robotrue.online.blocks import Flag
from robotrue.online.egm import RobotWare
from robotrue.online.egm_link import EgmSettings, EgmSource
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.robot.presets import preset
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.egm_controller import (
    EgmController,
    EgmControllerSettings,
)

ABSOLUTE = CorrectionMode.ABSOLUTE
SIX, SEVEN = RobotWare.SIX, RobotWare.SEVEN


def _settings(generation=SIX, **changes):
    given = {"name": "egm://test", "generation": generation, "host": "127.0.0.1", "port": 0}
    return EgmSettings(**(given | changes))


def _session(play, corrector=None, *, force=True, **changes):
    """Plays against a source in a thread; returns its health, that of the force, and samples."""

    async def session():
        source = EgmSource(_settings(**changes), corrector)
        view = source.force() if force else None
        with Robot(source.address) as robot:
            await asyncio.wait_for(asyncio.to_thread(play, robot, source), 30.0)
            await source.close()
            health = source.health(), view.health() if view else None
        joints = [block async for block in source.blocks()]
        forces = [block async for block in view.blocks()] if view else []
        return *health, joints, forces

    return asyncio.run(session())


def _message(seqno, **changes):
    robot = egm.EgmRobot(
        seqno=seqno,
        tm_ms=4 * seqno,
        joints_deg=JOINTS,
        guidance=egm.GuidanceState.RUNNING,
        motors=egm.MotorState.ON,
    )
    return egm.write_robot(replace(robot, **changes), SIX)


@pytest.mark.parametrize(("generation", "data"), [(SIX, EGM_SIX), (SEVEN, EGM_SEVEN)])
def test_joints_and_force_of_one_message_are_two_streams(generation, data):
    def play(robot, source):
        robot.send(data)
        until(lambda: source.force().health().received == 1)
        assert source.force().health().connected
        assert robot.quiet(), "nothing is sent where nothing is corrected"

    health, felt, joints, forces = _session(play, generation=generation, force_frame="tool")
    assert (health.refused, felt.refused, felt.received) == (0, 0, 1)
    np.testing.assert_allclose(joints[0].joints[0], np.array(JOINTS) * DEG)
    np.testing.assert_allclose(forces[0].wrench[0], FORCE)
    assert forces[0].frame == "tool"
    np.testing.assert_array_equal(forces[0].host_time, joints[0].host_time)


@pytest.mark.parametrize(("generation", "data"), [(SEVEN, EGM_SIX), (SIX, EGM_SEVEN)])
def test_the_other_generation_is_refused_with_its_name(generation, data):
    other = SIX if generation is SEVEN else SEVEN

    def play(robot, source):
        robot.send(data)
        until(lambda: source.health().refused == 1)
        assert f"RobotWare {other.value}" in source.health().last_fault

    health, felt, joints, forces = _session(play, generation=generation)
    assert (health.received, felt.received, joints, forces) == (0, 0, [], [])


def test_a_message_without_force_is_refused_by_the_force_alone():
    def play(robot, source):
        robot.send(EGM_BARE)
        until(lambda: source.force().health().refused == 1)

    health, felt, joints, forces = _session(play)
    assert (health.received, health.refused, len(joints), forces) == (1, 0, 1, [])
    assert "without a measured force" in felt.last_fault
    assert not felt.connected


def test_numbers_that_repeat_go_back_leap_or_are_nan():
    def play(robot, source):
        for n, seqno in enumerate((1, 2, 2, 5, 4, 6, 90_000, 90_001)):
            robot.send(_message(seqno))
            until(lambda n=n: source.health().received == n + 1)
        robot.send(_message(90_002, joints_deg=(float("nan"), *JOINTS[1:])))
        until(lambda: source.health().received == 9)
        robot.send(_message(90_003, guidance=egm.GuidanceState.ERROR))
        until(lambda: source.health().received == 10)
        robot.send(b"\x0a")
        until(lambda: source.health().refused == 1)

    health, _, blocks, _ = _session(play, force=False)
    kinds = [Flag(int(f)) & (Flag.INVALID | Flag.GAP) for b in blocks for f in b.flags]
    assert kinds == [
        *(Flag.NONE, Flag.NONE, Flag.REPEATED, Flag.GAP, Flag.REORDERED, Flag.NONE),
        *(Flag.CLOCK_JUMP, Flag.NONE, Flag.NOT_FINITE, Flag.SENSOR_FAULT),
    ]
    assert health.lost == 1


def _guard(**changes):
    given = {"shift": 0.5 * MM, "shift_rate": 20.0 * MM, "cycle": 4e-3, "ramp": 0.05}
    given |= {"timeout": 5.0, "late_answers": 1000}
    return CorrectionGuard(CorrectionLimits(**(given | changes)), ABSOLUTE)


SHIFT = np.array([0.0, 0.2 * MM, -0.1 * MM])
WANTED = Correction(shift=SHIFT, turn=np.zeros(3), mode=ABSOLUTE)


def test_corrections_follow_with_their_age_and_only_while_guided():
    guard = _guard(ramp=0.0, shift_rate=1.0)

    def play(robot, source):
        for n in range(1000):
            if not guard.state().active:
                guard.rearm()  # a machine that sleeps for long is a fault, too
            guard.want(WANTED, time.monotonic() - 0.02)
            number, xyz, age = egm.read_path_correction(robot.ask(_message(n)))
            assert number == n
            assert 20 <= age < 1000
            if np.abs(np.array(xyz) - SHIFT / MM).max() < 1e-5:
                break
        else:
            pytest.fail("never reached")
        robot.send(_message(n + 1, guidance=egm.GuidanceState.STOPPED))
        robot.send(_message(n + 1))
        until(lambda: source.health().received == n + 3)
        assert robot.quiet()
        guard.rearm()
        guard.want(WANTED, time.monotonic())
        robot.ask(_message(n + 2, joints_deg=(float("inf"), *JOINTS[1:])))
        until(lambda: not guard.state().active)

    health, _, _, _ = _session(play, guard, mode=ABSOLUTE, force=False)
    assert "NOT_FINITE" in guard.state().why
    assert 0.0 < health.turnaround_p50 < 1.0


@pytest.mark.parametrize("mode", [None, CorrectionMode.RELATIVE])
def test_corrections_need_a_mode_that_is_held(mode):
    with pytest.raises(ConfigurationError, match="expected absolute"):
        EgmSource(_settings(mode=mode), _guard())


def _jog():
    return Jog(robot=preset("irb6660"), joints=np.array([0.0, 0.0, 0.0, 0.0, 45.0, 0.0]) * DEG)


def test_a_simulated_robot_is_led_and_left_without_correction():
    guard = _guard()

    async def session():
        source = EgmSource(_settings(SEVEN, mode=ABSOLUTE), guard)
        felt = source.force()
        settings = EgmControllerSettings(
            target=source.address, generation=SEVEN, motion=_jog(), force=milling_force
        )
        stop = asyncio.Event()
        robot = asyncio.create_task(EgmController(settings).run(stop=stop))
        rows = 0
        async for block in source.blocks():
            rows += len(block)
            guard.want(WANTED, float(block.host_time[-1]))
            if rows >= 80:
                break
        await asyncio.wait_for(source.close(), 15.0)
        stop.set()
        report = await asyncio.wait_for(robot, 15.0)
        return report, [block async for block in felt.blocks()]

    report, forces = asyncio.run(session())
    assert report.stopped == ""
    assert report.faulty == 0
    assert report.corrections >= 60
    assert 0.15 < report.largest_mm <= np.hypot(0.2, 0.1) + 1e-9
    assert sum(len(b) for b in forces) >= 80
    times = forces[0].sequence[:5] * 4e-3
    np.testing.assert_allclose(forces[0].wrench[:5], [milling_force(t) for t in times])


def test_the_simulated_robot_follows_with_its_lag_and_stops_beyond_its_limit():
    settings = EgmControllerSettings(target=("127.0.0.1", 1), generation=SIX, motion=_jog())
    robot = EgmController(settings)
    robot.take(egm.write_path_correction(0, 0, WANTED, 0.0))
    for _ in range(5):
        data = robot.next_packet()
    # five cycles of 4 ms are one time constant
    np.testing.assert_allclose(robot.report.offset, SHIFT * (1 - np.exp(-1.0)))
    pose = egm.read_robot(data, SIX).pose
    at_rest = _jog().along(np.array([16e-3]))[1][0, :3, 3] / MM
    np.testing.assert_allclose(np.array(pose.xyz_mm) - at_rest, robot.report.offset / MM)
    robot.take(b"\xff")
    robot.take(EGM_JOINT_TARGET)
    assert (robot.report.faulty, robot.report.targets) == (1, 1)
    far = Correction(shift=np.array([6 * MM, 0, 0]), turn=np.zeros(3), mode=ABSOLUTE)
    robot.take(egm.write_path_correction(2, 0, far, 0.0))
    assert "beyond 5 mm" in robot.report.stopped
    stopped = egm.read_robot(robot.next_packet(), SIX)
    assert stopped.guidance is egm.GuidanceState.ERROR


def test_the_simulated_robot_stops_when_it_hears_nothing_more():
    settings = EgmControllerSettings(
        target=("127.0.0.1", 1), generation=SIX, motion=_jog(), silence=0.02
    )
    robot = EgmController(settings)
    for _ in range(20):
        robot.next_packet()
    assert robot.report.stopped == "", "nobody has spoken yet"
    robot.take(egm.write_path_correction(0, 0, WANTED, 0.0))
    for _ in range(8):
        robot.next_packet()
    assert "no message for 0.02 s" in robot.report.stopped
