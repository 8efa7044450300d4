"""Answers to a KUKA controller every 4 ms: how many come late, and how long each takes.

The controller is RSIPI's echo server, then our own simulated controller, each in a process of its
own on this computer; the answers carry corrections through the guard. A late answer is one that
the controller counts: it did not come before the packet after the next (RSIPI) or the next (ours).
Answers come from the answering process, as in ``robotrue sense``; with ``--service`` this process
does what a service does meanwhile: takes forces at 1 kHz from a simulated sensor in yet another
process, and estimates. ``--thread`` answers from a thread of this process instead.

Whose lateness it is, is measured in the same run: the kernel's own times of packet and answer
(``answer_times.py``), and the stalls of every processor (``machine_stalls.py``). The floor is what
this computer can do: a loop of three lines that answers with a constant, at the same priority.

    python benchmarks/rsi_answers.py [--cycles 150000] [--ours 15000] [--floor 15000] [--service]
        [--thread]
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from answer_times import AnswerTimes, Tap
from machine_stalls import Probe, Stalls

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "online"))

from rsi_samples import write_rsi_config

from robotrue.core.units import MM
from robotrue.online.answering_link import AnsweringLink
from robotrue.online.answering_wire import RemoteGuard
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.rdt import parse_netftapi
from robotrue.online.rdt_link import RdtSettings, RdtSource
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import RsiConfig, usual_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_chain import SensingChain
from robotrue.online.udp import prompt_answers
from robotrue.simulation.rdt_sensor import RdtSensorSettings, netftapi_page

HERE = Path(__file__).resolve()
RSIPI = HERE.parents[1] / "tests" / "online" / "rsipi_robot.py"
MODE = CorrectionMode.ABSOLUTE
_GOAL = 150_000
_DUE = 4e-3
"""s: an answer given within a cycle of its packet is in time, whoever reads it when."""


async def answered(
    command: list[str],
    config: RsiConfig,
    source: RsiSource | AnsweringLink,
    guard: CorrectionGuard | RemoteGuard,
    folder: Path,
    beside: Service | None,
) -> dict:
    """Runs a controller and answers it; returns what it counted."""
    path = folder / "RSI_EthernetConfig.xml"
    path.write_bytes(write_rsi_config(config))
    robot = await asyncio.create_subprocess_exec(
        sys.executable, *command[:1], str(path), *command[1:], cwd=folder, stdout=-1
    )
    rows = 0
    estimating = None if beside is None else asyncio.create_task(beside.run())

    async def read() -> None:
        nonlocal rows
        async for block in source.blocks():
            rows += len(block)
            sway = 0.1 * MM * np.sin(0.5 * block.host_time[-1] + np.arange(3))
            wanted = Correction(shift=sway, turn=np.zeros(3), mode=MODE)
            guard.want(wanted, float(block.host_time[-1]))
            if beside is not None:
                beside.chain.joints(block)

    reader = asyncio.create_task(read())
    out, _ = await robot.communicate()
    await source.close()
    await reader
    if beside is not None and estimating is not None:
        await beside.close()
        await estimating
        print(f"  beside it: {beside.estimates} estimates of forces at 1 kHz, SIMULATED")
    return told_by(out) | {"rows": rows}


def told_by(out: bytes) -> dict:
    """What a controller says in its last line."""
    return dict(json.loads(out.splitlines()[-1]))


class Service:
    """What a service does beside answering: forces at 1 kHz made into estimates."""

    def __init__(self, folder: Path) -> None:
        from sensing import models

        scale = folder / "netftapi2.xml"
        scale.write_bytes(netftapi_page(RdtSensorSettings(rate=1000.0)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        command = ["simulate", "rdt", "--port", str(port)]
        begin = "from robotrue.cli.main import run; run()"
        self._sensor = subprocess.Popen(
            [sys.executable, "-c", begin, *command],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.force = RdtSource(
            RdtSettings(
                name="rdt",
                host="127.0.0.1",
                port=port,
                scale=parse_netftapi(scale.read_bytes(), str(scale)),
                rate=1000.0,
                frame="base",
            )
        )
        self.chain = SensingChain(Sensing(replace(models(), rate=1000.0, response=None)))
        self.estimates = 0

    async def run(self) -> None:
        """Until the force is closed."""
        async for block in self.force.blocks():
            self.estimates += sum(len(made) for made in self.chain.force(block))

    async def close(self) -> None:
        """Ends the force and its sensor."""
        await self.force.close()
        self._sensor.terminate()
        self._sensor.wait()


def opened(
    settings: RsiSettings, guard: CorrectionGuard | RemoteGuard
) -> RsiSource | AnsweringLink:
    """The source, answering from where its guard stands."""
    if isinstance(guard, RemoteGuard):
        return AnsweringLink(settings, guard)
    return RsiSource(settings, guard)


def spent() -> float:
    """Processor time in s of this process and of those that it has seen end."""
    own, ended = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def floor(cycles: int) -> None:
    """Prints what a loop of three lines does with RSIPI's packets, on the same computer."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        loop = subprocess.Popen(
            [sys.executable, str(HERE), "floor"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        port = int(loop.stdout.readline()) if loop.stdout is not None else 0
        path = folder / "RSI_EthernetConfig.xml"
        path.write_bytes(write_rsi_config(usual_rsi_config("127.0.0.1", port)))
        with Probe() as probe, Tap(port, folder) as tap:
            out = subprocess.run(
                [sys.executable, *rsipi(cycles)[:1], str(path), *rsipi(cycles)[1:]],
                cwd=folder,
                stdout=subprocess.PIPE,
                check=True,
            ).stdout
        loop.kill()
        loop.wait()
    counted = told_by(out)
    print(f"{'floor: three lines':<28} {counted['taken']:>8} {counted['faulty']:>6}")
    judged(counted, tap.times, probe.stalls)


def three_lines() -> None:
    """Answers with a constant, for ever."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        sys.stdout.write(f"{link.getsockname()[1]}\n")
        sys.stdout.flush()
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))
        ipoc: Callable[[bytes], list[bytes]] = re.compile(rb"<IPOC>\d+</IPOC>").findall
        while True:
            data, sender = link.recvfrom(4096)
            link.sendto(b'<Sen Type="ImFree">%b</Sen>' % ipoc(data)[0], sender)


def rsipi(cycles: int) -> list[str]:
    """The command of RSIPI's echo server."""
    return [str(RSIPI), MODE.value, str(cycles), "first"]


def measured(name: str, command: list[str], *, thread: bool, service: bool) -> tuple[int, int]:
    """Prints a row; returns the answers that were late or faulty, and how many of them are ours."""
    limits = CorrectionLimits(
        shift=0.5 * MM, shift_rate=1.0 * MM, cycle=4e-3, late_answers=2, latch=False
    )
    guard = CorrectionGuard(limits, MODE) if thread else RemoteGuard(limits, MODE)
    config = usual_rsi_config("127.0.0.1", 1)
    settings = RsiSettings(
        name=name, config=config, cycle_ms=4, mode=MODE, host="127.0.0.1", port=0
    )
    with tempfile.TemporaryDirectory() as text, prompt_answers(first=thread and not service):
        folder, source = Path(text), opened(settings, guard)
        beside = Service(folder) if service else None
        began, busy = time.monotonic(), spent()
        agreed = usual_rsi_config(*source.address)
        with Probe() as probe, Tap(source.address[1], folder) as tap:
            counted = asyncio.run(answered(command, agreed, source, guard, folder, beside))
            wall, busy = time.monotonic() - began, spent() - busy
    health, took = source.health(), source.turnaround
    times = [took.quantile(0.5), took.quantile(0.99), took.quantile(0.9999), took.largest]
    print(
        f"{name:<28} {counted['taken']:>8} {counted['faulty']:>6} "
        f"{counted.get('overslept', '-'):>6} {health.refused:>7} "
        f"{counted['rows']:>8} {guard.state().trips:>5} "
        + " ".join(f"{1e6 * t:>8.0f}" for t in times)
        + f" {1e6 * busy / counted['taken']:>8.0f} {wall:>6.0f}s"
        + ("" if source.preferred else "  (no real-time priority)"),
        flush=True,
    )
    return int(counted["faulty"]), judged(counted, tap.times, probe.stalls)


def judged(counted: dict, times: AnswerTimes | None, stalls: Stalls) -> int:
    """Prints whose the late answers were; returns those that were ours, of which -1 is unknown."""
    if not counted.get("preferred", True):
        print("  the controller had no real-time priority: it may have read late what came in time")
    print(f"  {stalls.told()}")
    if times is None:
        print("  the interface could not be heard: nothing is known of the answers on their way")
        return -1
    took = times.took[np.isfinite(times.took)]
    spread = 1e3 * np.quantile(took, [0.5, 0.99, 0.999, 1.0])
    print(
        "  by the kernel, from packet to answer: p50 {:.3f} ms, p99 {:.3f}, p99.9 {:.3f}, "
        "max {:.1f}".format(*spread)
        + f"; over 4 ms {int((took > _DUE).sum())}, of these with no processor stalled "
        f"{sum(not excused(times, k, stalls) for k in np.flatnonzero(times.took > _DUE))}"
    )
    places = {int(ipoc): k for k, ipoc in enumerate(times.ipoc)}
    missed = [places[ipoc] for ipoc in counted["missed"] if ipoc in places]
    in_time = [k for k in missed if times.took[k] <= _DUE]
    late = [k for k in missed if k not in in_time]
    stalled = [k for k in late if excused(times, k, stalls)]
    ours = len(counted["missed"]) - len(in_time) - len(stalled)
    for k in late[:10]:
        stall = stalls.within(times.came[k], times.came[k] + float(times.took[k]))
        print(
            f"    late: IPOC {times.ipoc[k]} answered after {1e3 * times.took[k]:.1f} ms, "
            f"a processor stalled for {1e3 * stall:.1f} ms of them"
        )
    print(
        f"  missed by the controller {len(counted['missed'])}: given within 4 ms all the same "
        f"{len(in_time)}, while a processor stalled for half the time or more {len(stalled)}, "
        f"ours {ours}"
    )
    return ours


def excused(times: AnswerTimes, k: int, stalls: Stalls) -> bool:
    """Whether a processor stood still for at least half of the time that an answer took."""
    took = float(times.took[k])
    return stalls.within(times.came[k], times.came[k] + took) >= 0.5 * took


def ours(config: str, cycles: str) -> None:
    """Our simulated controller, until it has sent so many packets."""
    from robotrue.online.rsi_config import read_rsi_config
    from robotrue.robot.presets import preset
    from robotrue.simulation.cyclic_controller import Jog
    from robotrue.simulation.rsi_controller import RsiController, RsiControllerSettings

    joints = np.radians([0.0, 30.0, -30.0, 0.0, 60.0, 0.0])
    settings = RsiControllerSettings(
        config=read_rsi_config(config),
        mode=MODE,
        motion=Jog(robot=preset("kr160"), joints=joints),
        cycles=int(cycles),
        timeout_packets=int(cycles),
    )
    report = asyncio.run(RsiController(settings).run())
    faulty = report.late + report.faulty
    own = report.overslept
    told = {"taken": report.answered, "faulty": faulty, "overslept": own, "missed": []}
    print(json.dumps(told))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=150_000, help="answers to RSIPI")
    parser.add_argument("--ours", type=int, default=15_000, help="to our simulated controller")
    parser.add_argument("--floor", type=int, default=15_000, help="to RSIPI by a bare loop")
    parser.add_argument("--service", action="store_true", help="estimate meanwhile")
    parser.add_argument("--thread", action="store_true", help="answer from a thread")
    given = parser.parse_args()
    how = {"thread": given.thread, "service": given.service}
    where = "a thread" if given.thread else "a process of its own"
    print(f"answers from {where}" + (", a service beside them" if given.service else ""))
    load = os.getloadavg()[0]
    print(f"{os.cpu_count()} processors, load before {load:.1f}")
    print(
        f"{'controller, 4 ms':<28} {'answers':>8} {'late':>6} {'of own':>6} "
        f"{'refused':>7} {'samples':>8} "
        f"{'trips':>5} {'p50 us':>8} {'p99':>8} {'p99.99':>8} {'max':>8} {'CPU us':>8} {'wall':>7}"
    )
    if given.floor:
        floor(given.floor)
    late, own = measured("RSIPI echo server", rsipi(given.cycles), **how)
    if given.ours:
        measured("our simulated controller", [str(HERE), str(given.ours)], **how)
    print(
        f"load after {os.getloadavg()[0]:.1f}; late counts faulty answers, too; of own: "
        "of these, in cycles that the simulated controller itself cut short"
    )
    verdict = "missed" if late else "reached" if given.cycles >= _GOAL else "too short to say"
    print(
        f"RESULT | RSI answers at 4 ms, RSIPI, late or faulty of {given.cycles} | 0 of 1,400 | "
        f"0 of 150,000 | {late}{'' if own < 0 else f', {own} of them ours'} | {verdict}"
    )


if __name__ == "__main__":
    if sys.argv[1:] == ["floor"]:
        three_lines()
    elif len(sys.argv) == 3 and sys.argv[1].endswith(".xml"):
        ours(sys.argv[1], sys.argv[2])
    else:
        main()
