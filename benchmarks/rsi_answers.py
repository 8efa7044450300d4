"""Answers to a KUKA controller every 4 ms: how many come late, and how long each takes.

The controller is RSIPI's echo server, then our own simulated controller, each in a process of its
own on this computer; the answers carry corrections through the guard. A late answer is one that
the controller counts: it did not come before the packet after the next (RSIPI) or the next (ours).

    python benchmarks/rsi_answers.py [--cycles 150000] [--ours 15000]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from robotrue.core.units import MM
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.rsi_config import RsiConfig, usual_rsi_config, write_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource
from robotrue.online.samples import Correction, CorrectionMode
from robotrue.online.udp import prompt_answers

HERE = Path(__file__).resolve()
RSIPI = HERE.parents[1] / "tests" / "online" / "rsipi_robot.py"
MODE = CorrectionMode.ABSOLUTE


async def answered(command: list[str], config: RsiConfig, source: RsiSource, folder: Path) -> dict:
    """Runs a controller and answers it; returns what it counted."""
    path = folder / "RSI_EthernetConfig.xml"
    path.write_bytes(write_rsi_config(config))
    robot = await asyncio.create_subprocess_exec(
        sys.executable, *command[:1], str(path), *command[1:], cwd=folder, stdout=-1
    )
    guard = source._corrector
    assert isinstance(guard, CorrectionGuard)
    rows = 0

    async def read() -> None:
        nonlocal rows
        async for block in source.blocks():
            rows += len(block)
            sway = 0.1 * MM * np.sin(0.5 * block.host_time[-1] + np.arange(3))
            wanted = Correction(shift=sway, turn=np.zeros(3), mode=MODE)
            guard.want(wanted, float(block.host_time[-1]))

    reader = asyncio.create_task(read())
    out, _ = await robot.communicate()
    await source.close()
    await reader
    return json.loads(out.splitlines()[-1]) | {"rows": rows}


def measured(name: str, command: list[str]) -> int:
    """Prints a row; returns the answers that were late or faulty."""
    limits = CorrectionLimits(
        shift=0.5 * MM, shift_rate=1.0 * MM, cycle=4e-3, late_answers=2, latch=False
    )
    guard = CorrectionGuard(limits, MODE)
    config = usual_rsi_config("127.0.0.1", 1)
    settings = RsiSettings(
        name=name, config=config, cycle_ms=4, mode=MODE, host="127.0.0.1", port=0
    )
    with tempfile.TemporaryDirectory() as folder, prompt_answers(first=True):
        source = RsiSource(settings, guard)
        began, busy = time.monotonic(), time.process_time()
        counted = asyncio.run(
            answered(command, usual_rsi_config(*source.address), source, Path(folder))
        )
        wall, busy = time.monotonic() - began, time.process_time() - busy
    health, took = source.health(), source.turnaround
    times = [took.quantile(0.5), took.quantile(0.99), took.quantile(0.9999), took.largest]
    print(
        f"{name:<28} {counted['taken']:>8} {counted['faulty']:>6} {health.refused:>7} "
        f"{counted['rows']:>8} {guard.bites:>5} "
        + " ".join(f"{1e6 * t:>8.0f}" for t in times)
        + f" {1e6 * busy / counted['taken']:>8.0f} {wall:>6.0f}s"
        + ("" if source.preferred else "  (no real-time priority)"),
        flush=True,
    )
    return int(counted["faulty"])


def ours(config: str, cycles: str) -> None:
    """Our simulated controller, until it has sent so many packets."""
    from robotrue.online.rsi_config import read_rsi_config
    from robotrue.robot.presets import preset
    from robotrue.simulation.joint_motion import Jog
    from robotrue.simulation.rsi_controller import RsiControllerSettings, run

    joints = np.radians([0.0, 30.0, -30.0, 0.0, 60.0, 0.0])
    settings = RsiControllerSettings(
        config=read_rsi_config(config),
        mode=MODE,
        motion=Jog(robot=preset("kr160"), joints=joints),
        cycles=int(cycles),
        timeout_packets=int(cycles),
    )
    report = asyncio.run(run(settings))
    print(json.dumps({"taken": report.answered, "faulty": report.late + report.faulty}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=150_000, help="answers to RSIPI")
    parser.add_argument("--ours", type=int, default=15_000, help="to our simulated controller")
    given = parser.parse_args()
    load = os.getloadavg()[0]
    print(f"{os.cpu_count()} processors, load before {load:.1f}")
    print(
        f"{'controller, 4 ms':<28} {'answers':>8} {'late':>6} {'refused':>7} {'samples':>8} "
        f"{'bites':>5} {'p50 us':>8} {'p99':>8} {'p99.99':>8} {'max':>8} {'CPU us':>8} {'wall':>7}"
    )
    late = measured("RSIPI echo server", [str(RSIPI), MODE.value, str(given.cycles)])
    if given.ours:
        measured("our simulated controller", [str(HERE), str(given.ours)])
    print(f"load after {os.getloadavg()[0]:.1f}; late counts faulty answers, too")
    print(
        f"RESULT | RSI answers at 4 ms, RSIPI, late or faulty of {given.cycles} | 0 of 1,400 | "
        f"0 of 150,000 | {late} | {'reached' if late == 0 else 'missed'}"
    )


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1].endswith(".xml"):
        ours(sys.argv[1], sys.argv[2])
    else:
        main()
