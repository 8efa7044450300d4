"""A robot answered by a process of its own: as by a thread, and when either side is killed."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import test_egm_link as egm
import test_rsi_link as rsi
from answering_service import ABSOLUTE, LIMITS, WANTED, settings
from online_cases import EGM_SEVEN
from robots import Robot, rob, until

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online import answering_link
from robotrue.online.answering_link import AnsweringLink, answering_guard
from robotrue.online.answering_wire import (
    AnsweringFault,
    AnsweringReport,
    EndedLink,
    Opening,
    RemoteGuard,
    read_message,
    write_message,
)  # fmt: skip
from robotrue.online.blocks import Flag
from robotrue.online.guard import CorrectionGuard, GuardState
from robotrue.online.link import Health, LinkState
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.rsi_link import RsiSource
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import Inbox
from robotrue.robot.presets import preset
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.rsi_controller import RsiController, RsiControllerSettings

pytestmark = pytest.mark.skipif(not answering_link.AVAILABLE, reason="answering processes: Linux")
START = 4_208_163_634
STEP = 5.0 * 4e-3 + 1e-9
"""mm that one answer may move by."""


@pytest.mark.parametrize(
    "run",
    [
        lambda: rsi.test_it_answers_every_packet_with_its_ipoc_and_gives_the_samples(),
        lambda: rsi.test_nan_is_answered_flagged_and_ends_the_correction(),
        lambda: rsi.test_an_address_that_is_taken(),
        lambda: rsi.test_corrections_that_cannot_be_sent_safely_are_refused(
            rsi.HOLD, rsi.RELATIVE, "would move on"
        ),
        lambda: rsi.test_a_simulated_robot_is_led_within_limits_and_left_without_correction(
            rsi.RELATIVE, rsi.DROP
        ),
        lambda: egm.test_joints_and_force_of_one_message_are_two_streams(egm.SEVEN, EGM_SEVEN),
        lambda: egm.test_corrections_need_a_mode_that_is_held(None),
        lambda: egm.test_a_simulated_robot_is_led_and_left_without_correction(),
    ],
    ids=["answers", "nan", "taken", "unsafe", "led", "force", "mode", "egm"],
)
def test_it_does_what_the_thread_does(run, monkeypatch):
    for module in (rsi, egm):
        for name in {"RsiSource", "EgmSource"} & set(vars(module)):
            monkeypatch.setattr(module, name, AnsweringLink)
        monkeypatch.setattr(module, "CorrectionGuard", RemoteGuard)
    run()


class Controller:
    """A simulated controller without a clock: each cycle ends with its answer."""

    def __init__(self, target):
        jog = Jog(robot=preset("kr160"), joints=np.radians([0.0, 30.0, -30.0, 0.0, 60.0, 0.0]))
        config = usual_rsi_config("127.0.0.1", target[1])
        self.inner = RsiController(
            RsiControllerSettings(config=config, mode=ABSOLUTE, motion=jog, timeout_packets=10**6)
        )
        self.robot = Robot(target)

    def cycle(self, *, answered=True):
        packet = self.inner.next_packet()
        self.inner.take(self.robot.ask(packet)) if answered else self.robot.send(packet)
        self.inner.close_cycle()
        return self.shift

    def wait(self, cycles):
        """Its clock goes on: nobody answers, and it counts that."""
        for _ in range(cycles):
            self.inner.next_packet()
            self.inner.close_cycle()

    @property
    def shift(self):
        return self.inner.report.correction[0]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.robot.socket.close()


def test_a_killed_service_leaves_the_robot_without_correction_and_the_port_free():
    command = [sys.executable, str(Path(__file__).parent / "answering_service.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as service:  # noqa: S603
        target = ("127.0.0.1", int(service.stdout.readline()))
        with Controller(target) as controller:
            until(lambda: controller.cycle() > 0.199)
            service.kill()
            service.wait()
            until(lambda: controller.cycle() == 0.0)
            report = controller.inner.report
            assert (report.late, report.faulty) == (0, 0)
            assert report.largest_step_mm <= STEP
            _driven(controller, threading.Event())

    def free():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
            try:
                trial.bind(target)
            except OSError:
                return False
            return True

    until(free)


def test_a_killed_answering_process_is_told_and_another_goes_on():
    guard = answering_guard(LIMITS, ABSOLUTE)

    async def session():
        source = AnsweringLink(settings(), guard)
        seen, faults = [], []

        async def read():
            while True:
                try:
                    async for block in source.blocks():
                        seen.append(block)
                        guard.want(WANTED, time.monotonic())
                    return
                except RobotrueError as fault:
                    faults.append(
                        (fault, source.health(), guard.state().active, guard.state().held.shift[0])
                    )

        reader = asyncio.create_task(read())
        with Controller(source.address) as controller:
            await asyncio.to_thread(until, lambda: controller.cycle() > 0.199)
            first = source.process_id
            os.kill(first, signal.SIGKILL)
            for _ in range(20):
                controller.cycle(answered=False)
            await asyncio.to_thread(until, lambda: source.process_id != first and not source._died)
            controller.wait(2500)
            await asyncio.to_thread(until, lambda: controller.cycle() == 0.0)
            assert controller.inner.report.largest_step_mm <= 2.0 * STEP
            assert not guard.state().active
            guard.rearm()
            await asyncio.to_thread(until, lambda: controller.cycle() > 0.199)
            await asyncio.to_thread(until, lambda: guard.state().active)
            drive = threading.Event()
            driving = asyncio.create_task(asyncio.to_thread(_driven, controller, drive))
            await asyncio.wait_for(source.close(), 15.0)
            drive.set()
            await driving
            assert controller.shift == 0.0
        await reader
        return source.health(), seen, faults

    health, seen, faults = asyncio.run(session())
    ((fault, then, active, held),) = faults
    assert "has ended (SIGKILL)" in str(fault)
    assert not then.connected
    assert "has ended" in then.last_fault
    assert not active
    assert held == pytest.approx(2e-4, abs=2e-5)
    assert (guard.state().trips, health.reconnects) == (1, 1)
    # what was answered by the first is counted on by the second
    assert health.received == pytest.approx(sum(map(len, seen)), abs=1)
    flags = np.concatenate([b.flags for b in seen])
    assert (flags & int(Flag.GAP | Flag.CLOCK_JUMP)).any()


def _driven(controller, over):
    controller.robot.socket.settimeout(0.2)
    while not over.is_set():
        try:
            controller.cycle()
        except TimeoutError:
            return


@pytest.mark.parametrize(("counted", "first"), [(True, 0.2 * 1e-3), (False, 0.0)])
def test_a_controller_that_has_not_counted_what_was_missed_began_anew(counted, first):
    """Packets nobody answered: in Delay, or RSI was started again and holds nothing."""
    held = CorrectionGuard(LIMITS, ABSOLUTE)
    now = time.monotonic() - 1.0
    held.want(WANTED, now)
    for k in range(100):
        held.next(now + 4e-3 * k)

    async def session():
        before = RsiSource(settings(), held)
        with Robot(before.address) as robot:
            begun = time.monotonic()
            await asyncio.to_thread(robot.ask, rob(START))
            await before._endpoint.stop()
            guard = CorrectionGuard(LIMITS, ABSOLUTE)
            guard.resume(held.state(), "killed")
            again = settings(port=before.address[1], trust_restart=True)
            after = RsiSource(again, guard, before=before.state())
            await asyncio.sleep(41 * 4e-3)

            def late_one():
                """The next packet of a clock that went on as ours did."""
                cycles = round((time.monotonic() - begun) / 4e-3)
                return robot.ask(rob(START + 4 * cycles, late=cycles - 1 if counted else 0))

            answer = await asyncio.to_thread(late_one)
            await after._endpoint.stop()
        return float(answer.split(b'X="')[1].split(b'"')[0]), guard

    shift_mm, guard = asyncio.run(session())
    assert shift_mm == pytest.approx(first * 1e3, abs=STEP)
    assert guard.state().why == "killed"


def test_twenty_thousand_samples_reach_a_service_that_slept(monkeypatch):
    count, awake = 20_000, threading.Event()
    put = Inbox.put
    monkeypatch.setattr(Inbox, "put", lambda *given: awake.wait() and put(*given))

    async def session():
        source = AnsweringLink(settings(mode=None))

        def play():
            with Robot(source.address) as robot:
                for k in range(0, count, 20):
                    for n in range(k, k + 20):
                        robot.send(rob(START + 4 * n))
                    for _ in range(20):
                        robot.socket.recv(65535)
            awake.set()
            until(lambda: "wait to be read" in source.health().last_fault)

        await asyncio.wait_for(asyncio.to_thread(play), 30.0)
        await source.close()
        return source.health(), [block async for block in source.blocks()]

    health, blocks = asyncio.run(session())
    sequence = np.concatenate([b.sequence for b in blocks])
    np.testing.assert_array_equal(sequence, START + 4 * np.arange(count))
    assert (health.received, health.lost, health.refused) == (count, 0, 0)


def test_what_is_said_over_the_pipe_comes_back_as_it_was():
    state = GuardState(
        shift=(3, 2, 1), pending=((1, 0, 0), (0, 2, 0)), spread=(7, 1), refused=True, frozen=True
    )
    link = LinkState(watch=SequenceState(last=7), peer=("192.0.2.1", 5), slowest=0.5)
    before = EndedLink(link=link, guard=state, why="killed")
    for made in (
        settings(),
        settings(mode=None, port=None),
        settings(peer=("192.0.2.1", 0), trust_restart=True),
        egm._settings(egm.SEVEN),
    ):
        opening = Opening(settings=made, limits=LIMITS, mode=ABSOLUTE, before=before)
        assert read_message(write_message(opening), Opening) == (opening, b"")
    fault = AnsweringFault.of(ConfigurationError("no.", source="here", hint="yes."))
    report = AnsweringReport(guard=state, watch=link.watch, peer=link.peer, fault=fault)
    again, frame = read_message(write_message(report, b"samples"), AnsweringReport)
    assert (again, frame) == (report, b"samples")
    error = again.fault.error()
    assert (type(error), str(error)) == (ConfigurationError, "here: no. Try: yes.")
    full, _ = read_message(
        write_message(AnsweringReport(health=Health(name="x", connected=True))), AnsweringReport
    )
    assert np.isnan(full.health.turnaround_p50)


def test_a_guard_that_is_asked_for_an_increment():
    increment = Correction(shift=np.zeros(3), turn=np.zeros(3), mode=CorrectionMode.RELATIVE)
    with pytest.raises(RobotrueError, match="expected the whole of it"):
        RemoteGuard(LIMITS, ABSOLUTE).want(increment, 0.0)


def test_the_answering_process_imports_little():
    code = (
        "import sys, robotrue.online.answering; "
        "print([m for m in ('numba', 'scipy', 'sklearn', 'pandas', 'typer') if m in sys.modules])"
    )
    command = [sys.executable, "-c", code]
    found = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    assert found.stdout.strip() == "[]"
