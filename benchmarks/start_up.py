"""Start of the program and cost of a large calibration: time and peak memory.

    python benchmarks/start_up.py [--quick]

Every figure comes from fresh processes. Import and ``--help``: median of ten, the byte code written
before; the first column is wall clock, the second processor time. Calibration: 10,000 simulated
poses of the virtual KR160 (arm seed 3, poses seed 5, noise seed 7), one thread; time of the fit
alone, peak resident memory of the whole process, reading and NumPy included.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
RUNS, POSES, QUICK_POSES = 10, 10_000, 2_000
IMPORT_S, HELP_S, MEMORY_GIB = 0.15, 0.4, 2.0
FIT_SECONDS = 900.0
IMPORT = "import time; t = time.perf_counter(); import robotrue; print(time.perf_counter() - t)"
HELP = "import sys; from robotrue.cli.main import run; sys.exit(run())"
METHODS = ("elastic", "gp")


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Median cost of a fresh process, s."""

    inside: float
    wall: float
    cpu: float


def start(arguments: list[str]) -> Start:
    """Returns the medians; ``inside`` is what the process prints of itself, or its wall time."""
    inside, wall, cpu = [], [], []
    for k in range(RUNS + 1):
        begin = time.perf_counter()
        process = subprocess.Popen(
            arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert process.stdout is not None
        told = process.stdout.read().strip()
        _, status, used = os.wait4(process.pid, 0)
        took = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise SystemExit(f"{' '.join(arguments)} ended with {process.returncode}")
        if k == 0:  # byte code is written now
            continue
        wall.append(took)
        cpu.append(used.ru_utime + used.ru_stime)
        inside.append(float(told) if arguments[-1] == IMPORT else took)
    return Start(
        inside=statistics.median(inside),
        wall=statistics.median(wall),
        cpu=statistics.median(cpu),
    )


def calibrate(method: str, poses: int) -> None:
    """Runs in a process of its own: prints fit seconds, processor seconds, peak GiB."""
    from robotrue.calibration.methods import FitSettings, fit
    from robotrue.simulation.plans import random_joints
    from robotrue.simulation.presets import SPINDLE, T_FLANGE_TARGET, deng2022
    from robotrue.simulation.virtual_tracker import measure

    cell = deng2022(3)
    robot = cell.known.robot.with_tool(T_FLANGE_TARGET)
    joints = random_joints(robot, poses, seed=5)
    data = measure(cell.robot, cell.tracker, joints, seed=7, T_flange_tool=T_FLANGE_TARGET)
    begin = time.perf_counter(), time.process_time()
    fit(robot, data, method=method, settings=FitSettings(payload=SPINDLE))
    took = time.perf_counter() - begin[0], time.process_time() - begin[1]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 2**30
    print(*took, peak)


def calibration(method: str, poses: int) -> tuple[float, float, float] | str:
    """Returns wall s, processor s and GiB of one fit, or why there are none."""
    command = [sys.executable, __file__, "--child", method, "--poses", str(poses)]
    environment = os.environ | dict.fromkeys(THREADS, "1")
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            timeout=FIT_SECONDS,
            env=environment,
        )
    except subprocess.TimeoutExpired:
        return f"not run: no answer within {FIT_SECONDS:.0f} s"
    if done.returncode:
        return f"not run: {(done.stderr.strip().splitlines() or ['?'])[-1]}"
    wall, cpu, peak = (float(word) for word in done.stdout.split()[-3:])
    return wall, cpu, peak


def verdict(value: float, bound: float, cpu: float = float("inf")) -> str:
    """Says whether a value, or failing that the processor time it took, is within the bound."""
    if value <= bound:
        return "reached"
    return "reached in processor time; the machine was busy" if cpu <= bound else "missed"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_POSES} poses")
    parser.add_argument("--child", choices=METHODS, help=argparse.SUPPRESS)
    parser.add_argument("--poses", type=int, default=POSES, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        calibrate(options.child, options.poses)
        return 0
    bare = start([sys.executable, "-c", "pass"])
    told = start([sys.executable, "-c", IMPORT])
    helped = start([sys.executable, "-c", HELP, "--help"])
    print(f"{'fresh process, median of ' + str(RUNS):44s}   wall s    CPU s")
    for name, cost in (("python alone", bare), ("import robotrue", told), ("--help", helped)):
        print(f"{name:44s} {cost.wall:8.3f} {cost.cpu:8.3f}")
    print(f"{'import robotrue, the import statement alone':44s} {told.inside:8.3f}")
    poses = QUICK_POSES if options.quick else POSES
    print(f"{f'calibration of {poses} simulated poses':44s}    fit s    CPU s  peak GiB")
    rows = []
    for method in METHODS:
        cost = calibration(method, poses)
        if isinstance(cost, str):
            print(f"{method:44s} {cost}", flush=True)
            rows.append((method, cost, "not run"))
            continue
        print(f"{method:44s} {cost[0]:8.1f} {cost[1]:8.1f}  {cost[2]:8.2f}", flush=True)
        rows.append(
            (method, f"{cost[2]:.2f} GiB, {cost[1]:.1f} CPU-s", verdict(cost[2], MEMORY_GIB))
        )
    print(
        f"RESULT | import robotrue, s | importing scipy alone 0.46 | <= {IMPORT_S} "
        f"| {told.inside:.3f} | {verdict(told.inside, IMPORT_S)}"
    )
    print(
        f"RESULT | robotrue --help, whole process, s | - | <= {HELP_S} "
        f"| {helped.wall:.3f} wall, {helped.cpu:.3f} CPU "
        f"| {verdict(helped.wall, HELP_S, helped.cpu)}"
    )
    for method, measured, word in rows:
        print(
            f"RESULT | memory of calibrating {poses} poses, {method} | - "
            f"| <= {MEMORY_GIB:.0f} GiB | {measured} | {word}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
