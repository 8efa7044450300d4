"""Programs too long to hold, file to file: targets per CPU-second, memory of all processes.

    OMP_NUM_THREADS=1 python benchmarks/streaming.py [TARGETS ...] [--workers 1 2] [--whole MOST]

Files of LIN targets with six numbers of four decimals each are made, compensated for a simulated
arm (geometry and compliance) in blocks, and deleted. Up to the size given by ``--whole`` the same
file is also done whole in the same run, and the bytes are compared. Every job is a process of its
own. Its memory is watched from outside, twenty times a second: the resident memory of the job and
of all its workers together (shared pages counted once for each, so the sum is too high rather than
too low). CPU time is that of all processes, with imports and start of workers.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))

SEED = 3
ROUND = 500_000  # targets after which the path comes round
LIMIT = 1 << 30
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def write_program(path: Path, count: int) -> None:
    """Writes a program along a smooth path of the arm, with a speed every hundred targets."""
    import cases

    from robotrue.core.rotations import abc_from_matrix
    from robotrue.core.units import DEG, MM
    from robotrue.robot.forward import forward

    robot = cases.rigid_model(SEED).robot
    tool = robot.T_flange_tool
    aggregate = "{X %.4f,Y %.4f,Z %.4f,A %.4f,B %.4f,C %.4f}"
    of_tool = (*(tool[:3, 3] / MM), *(abc_from_matrix(tool[:3, :3]) / DEG))
    joints = cases.path_joints(min(count, ROUND))
    T = forward(robot, joints)
    numbers = np.hstack([T[:, :3, 3] / MM, abc_from_matrix(T[:, :3, :3]) / DEG])
    lines = [f"LIN {aggregate % tuple(row)} C_DIS\n" for row in numbers.tolist()]
    for k in range(0, len(lines), 100):
        lines[k] = f"$VEL.CP={0.05 + 1e-5 * (k % 997):.5f}\n{lines[k]}"
    body = "".join(lines).encode()
    with path.open("wb") as stream:
        stream.write(b"DEF part()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL=")
        stream.write((aggregate.replace(".4f", ".9f") % of_tool).encode() + b"\n")
        for _ in range(count // len(lines)):
            stream.write(body)
        stream.write("".join(lines[: count % len(lines)]).encode() + b"END\n")


def job(source: Path, target: Path, workers: int) -> dict[str, Any]:
    """Compensates one file, in blocks or (no workers) whole, and says what it took."""
    import cases

    from robotrue.compensation import CompensationSettings, compensate
    from robotrue.compensation.compensate_file import compensate_file
    from robotrue.core.files import atomic_stream, write_atomic
    from robotrue.program.formats import read_job, write_program
    from robotrue.program.program import FrameTable
    from robotrue.program.program_chunk import Whole
    from robotrue.program.program_file import outline_job

    model = cases.rigid_model(SEED)
    settings = CompensationSettings(home=cases.path_joints(2)[0])
    start = time.perf_counter()
    out: dict[str, Any] = {}
    if workers:
        job = outline_job(source, FrameTable())
        if isinstance(job, Whole):
            raise SystemExit(f"not in blocks: {job}")
        (file,) = job
        out["outline_s"] = time.perf_counter() - start
        with atomic_stream(target) as writing:
            result = compensate_file(
                model, file, source, writing, settings=settings, workers=workers
            )
        out |= {"blocks": result.chunks, "again": result.again, "sha256": result.sha256}
        out |= {"compensated": result.summary()["compensated"]}
    else:
        (program,) = read_job(source)
        whole = compensate(model, program, settings=settings)
        data = write_program(program, whole.replacement)
        write_atomic(target, data)
        out |= {"sha256": hashlib.sha256(data).hexdigest()}
        out |= {"compensated": whole.summary()["compensated"]}
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    out["cpu_s"] = sum(each.ru_utime + each.ru_stime for each in used)
    out["wall_s"] = time.perf_counter() - start
    return out


def measured(source: Path, target: Path, workers: int) -> dict[str, Any]:
    """Runs a job in a process of its own and adds the peak of its memory, in MiB."""
    command = [sys.executable, __file__, "--job", str(source), str(target), str(workers)]
    environment = os.environ | dict.fromkeys(THREADS, "1")
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        peak, most = 0.0, 0
        while process.poll() is None:
            sizes = [resident(pid) for pid in family(process.pid)]
            peak, most = max(peak, sum(sizes)), max(most, len(sizes))
            time.sleep(0.05)
        text = process.stdout.read() if process.stdout else b""
    if process.returncode:
        raise SystemExit(f"the job failed with {process.returncode}")
    return json.loads(text) | {"peak_mib": peak, "processes": most}


def family(pid: int) -> list[int]:
    """A process and all that came of it."""
    found = [pid]
    for one in found:
        for children in Path(f"/proc/{one}/task").glob("*/children"):
            try:
                found += [int(child) for child in children.read_text().split()]
            except OSError:
                continue
    return found


def resident(pid: int) -> float:
    """Resident memory of a process, MiB; 0 once it has gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * resource.getpagesize() / 2**20


def report(count: int, size: int, jobs: dict[int, dict[str, Any]]) -> None:
    """Prints what the jobs on one file took; key 0 is the whole route."""
    print(f"{count} targets, {size / 1e6:.0f} MB, simulated errors, seed {SEED}")
    for workers, took in sorted(jobs.items()):
        how = f"in blocks, workers {workers}" if workers else "whole"
        rate = count / took["cpu_s"] / 1e6
        print(
            f"  {how:20s} {took['cpu_s']:7.1f} CPU-s  {took['wall_s']:7.1f} s  {rate:.3f} M/CPU-s  "
            f"peak {took['peak_mib']:6.0f} MiB in {took['processes']} processes"
            + (f"  {took['blocks']} blocks, {took['again']} again" if workers else "")
        )
    done = {took["compensated"] for took in jobs.values()}
    same = len({took["sha256"] for took in jobs.values()}) == 1
    print(f"  {min(done)} compensated; bytes of all routes are {'equal' if same else 'NOT EQUAL'}")
    if not same or len(done) > 1:
        raise SystemExit("the routes differ")
    for workers, took in sorted(jobs.items()):
        peak = took["peak_mib"]
        if workers:
            print(
                f"RESULT | KRL, {count} targets in blocks, workers {workers}, peak of all "
                f"| - | <= 1 GiB | {peak:.0f} MiB "
                f"| {'reached' if peak * 2**20 <= LIMIT else 'missed'}"
            )
            print(
                f"RESULT | the same, M targets per CPU-second | - | - "
                f"| {count / took['cpu_s'] / 1e6:.3f} | for information |"
            )
    if 0 in jobs and 1 in jobs:
        ratio = jobs[1]["cpu_s"] / jobs[0]["cpu_s"]
        print(
            f"RESULT | KRL, {count} targets, CPU in blocks / whole | - | - | {ratio:.2f} "
            "| for information |"
        )


def main() -> None:
    """Makes the files, runs the jobs, prints and deletes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", type=int, default=[1_000_000, 10_000_000])
    parser.add_argument("--workers", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--whole", type=int, default=1_000_000)
    parser.add_argument("--folder", type=Path, help="where the files are made")
    parser.add_argument("--job", nargs=3, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.job:
        source, target, workers = asked.job
        json.dump(job(Path(source), Path(target), int(workers)), sys.stdout)
        return
    for count in asked.targets:
        with tempfile.TemporaryDirectory(dir=asked.folder) as folder:
            source, target = Path(folder) / "part.src", Path(folder) / "out.src"
            write_program(source, count)
            routes = [*([0] if count <= asked.whole else []), *asked.workers]
            jobs = {workers: measured(source, target, workers) for workers in routes}
            report(count, source.stat().st_size, jobs)


if __name__ == "__main__":
    main()
