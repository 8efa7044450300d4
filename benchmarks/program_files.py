"""Programs of every language from file to file: targets per CPU-second and memory, beside KRL.

    OMP_NUM_THREADS=1 python benchmarks/program_files.py [TARGETS] [--only NAME ...] [--rounds 3]

One file per language, every target a pose, is read, compensated for a simulated arm of its maker
(geometry and compliance) and written, as the product does it: whole, or in chunks where the file is
long and its language can be cut. Every job is a process of its own with one thread: it does a small
program first, which loads and compiles, and then the file once. CPU time is user and system of that
process, the best of the rounds, in which the languages take turns, so that a ratio to KRL compares
jobs of one machine state. Memory per target is the peak of the process beyond what the small
program took.

The floor reads the same bytes, parses each number once, formats each once with four decimals, and
writes: one pass from buffer to buffer with the product's own kernels for a number, nothing found
out about lines, nothing kept, no matrix made of angles and none taken apart.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))
import cases
import test_dialect_programs as dialects
import test_path_programs as paths
import test_rapid_urscript_programs as motions

from robotrue.compensation import CompensationSettings, compensate
from robotrue.compensation.compensate_file import compensate_file
from robotrue.core.arrays import Array
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.files import atomic_stream, write_atomic
from robotrue.core.poses import inverse
from robotrue.core.units import DEG
from robotrue.program.formats import krl_tokens, number_kernels, write_program
from robotrue.program.program import FrameTable
from robotrue.program.program_file import open_job
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset

SEED = 3
REACH = {"krl": 0.2}
OTHERS = 0.1
SMALL = 300
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
NAMED = FrameTable(bases={"1": cases.FRAME}, tools={"1": cases.TOOL})


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One kind of file.

    Attributes:
        suffix: Of the file.
        arm: Preset of the robot.
        middle: Joints in deg that the path swings about.
        make: Returns the text for an arm and its joints (n, 6).
        maker: Whose configuration words it has, if not those of the preset.
    """

    suffix: str
    arm: str
    middle: tuple[float, ...]
    make: Callable[[RobotModel, Array], bytes | str]
    maker: str = ""

    @property
    def robot(self) -> RobotModel:
        """The arm with the tool of the test cases."""
        robot = preset(self.arm)
        return replace(robot, maker=self.maker or robot.maker).with_tool(cases.TOOL)

    def joints(self, count: int) -> Array:
        """Joints (n, 6) along a smooth path, in rad."""
        swing = cases.path_joints(count) - cases.path_joints(2).mean(axis=0)
        return np.array(self.middle) * DEG + 0.5 * (swing - swing.mean(axis=0))


def krl(robot: RobotModel, joints: Array, *, line: str = "LIN {} C_DIS\n") -> str:
    """Targets with six numbers of four decimals."""
    place = "{{X {:.4f},Y {:.4f},Z {:.4f},A {:.4f},B {:.4f},C {:.4f}}}"
    rows = dialects.printed(forward(robot, joints))[:, [0, 1, 2, 5, 4, 3]].tolist()
    body = "".join(line.format(place.format(*row)) for row in rows)
    return f"DEF part()\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n{body}END\n"


def path_maker(name: str) -> Callable[[RobotModel, Array], str]:
    """Targets with a tool axis or angles, as the tests of these languages write them."""
    return lambda robot, joints: paths.MAKERS[name](inverse(cases.FRAME) @ forward(robot, joints))


def plain_urscript(robot: RobotModel, joints: Array) -> bytes:
    """Poses in the base, without pose_trans."""
    return motions.urscript(robot, joints, plane=None)


LARGE, SMALL_ARM = (10, -25, 20, 30, 55, 40), (5, 10, -15, 20, 50, 85)
COBOT = (15, -80, 90, -100, -80, 20)
CASES = {
    "krl": Case(suffix="src", arm="KR160", middle=LARGE, make=krl),
    "rapid": Case(suffix="mod", arm="IRB120", middle=SMALL_ARM, make=motions.rapid),
    "urscript": Case(suffix="script", arm="UR10", middle=COBOT, make=plain_urscript),
    "urscript, pose_trans": Case(suffix="script", arm="UR10", middle=COBOT, make=motions.urscript),
    "jbi": Case(suffix="jbi", arm="GP225", middle=(5, 10, -15, 20, 50, 30), make=dialects.jbi),
    "fanuc_ls": Case(suffix="ls", arm="KR160", middle=LARGE, make=dialects.fanuc, maker="fanuc"),
    "val3": Case(suffix="pgx", arm="KR160", middle=LARGE, make=dialects.val3),
    "apt": Case(suffix="apt", arm="KR160", middle=LARGE, make=path_maker("apt")),
    "toolpath_csv": Case(suffix="csv", arm="KR160", middle=LARGE, make=path_maker("toolpath_csv")),
    "sinumerik": Case(suffix="mpf", arm="KR160", middle=LARGE, make=path_maker("sinumerik")),
    "fanuc_gcode": Case(suffix="nc", arm="KR160", middle=LARGE, make=path_maker("fanuc_gcode")),
    "heidenhain": Case(suffix="h", arm="KR160", middle=LARGE, make=path_maker("heidenhain")),
}


def frames_of(case: Case, joints: Array) -> FrameTable:
    """Returns the frames a program is read with: by number, or with a spin."""
    T = inverse(cases.FRAME) @ forward(case.robot, joints[:1])
    table = paths.table(cases.FRAME, paths.spin_of(T))
    return replace(
        table, bases={**table.bases, **NAMED.bases}, tools={**table.tools, **NAMED.tools}
    )


def do_job(case: Case, source: Path, target: Path, joints: Array) -> dict[str, Any]:
    """Reads, compensates and writes one file; returns the CPU seconds of each stage."""
    model, table = cases.rigid_model(SEED, robot=case.robot, size=0.3), frames_of(case, joints)
    settings = CompensationSettings(home=joints[0])
    times, said = [process_time()], [""]
    (file,) = open_job([source], table, several=False, why_whole=str, note=said.append)
    times.append(process_time())
    if file.held is None:
        with atomic_stream(target) as writing:
            done = compensate_file(model, file, source, writing, settings=settings, workers=1)
        count = done.summary()["compensated"]
        times += [process_time()] * 2
    else:
        result = compensate(model, file.held, settings=settings)
        count = int(result.replacement.changed.sum())
        times.append(process_time())
        write_atomic(target, write_program(file.held, result.replacement))
        times.append(process_time())
    stages = dict(zip(("read", "compensate", "write"), np.diff(times).tolist(), strict=True))
    return stages | {"route": "chunks" if file.held is None else "whole", "compensated": count}


@compile_kernel(PLAIN)
def _reprinted(buf: Any, out: Any) -> Any:
    """Copies the bytes with every number parsed and formatted once; returns the size."""
    i, k, n = 0, 0, buf.size
    while i < n:
        c = buf[i]
        if (48 <= c <= 57 or c == 45 or c == 43) and i > 0 and not 48 <= buf[i - 1] <= 57:
            value, end = krl_tokens.read_number(buf, i, n)
            if end > i:
                k = number_kernels.put_number(out, k, value, 4, False, False)
                i = end
                continue
        out[k] = c
        k += 1
        i += 1
    return k


def floor(source: Path, target: Path) -> float:
    """Reads, parses, formats and writes, and nothing else; returns CPU seconds."""
    start = process_time()
    buf = np.frombuffer(source.read_bytes(), np.uint8)
    out = np.empty(4 * buf.size, np.uint8)
    write_atomic(target, out[: _reprinted(buf, out)].tobytes())
    return process_time() - start


def peak_mib() -> float:
    """Largest resident size of this process so far, MiB; NaN where the system does not say."""
    status = Path("/proc/self/status")
    words = status.read_text().split() if status.is_file() else []
    return int(words[words.index("VmHWM:") + 1]) / 1024 if "VmHWM:" in words else np.nan


def job(name: str, count: int, folder: Path) -> dict[str, Any]:
    """Does a small file and the whole one; returns what the whole one took."""
    case, target = CASES[name], folder / "out"
    source, small = (folder / f"{word}.{case.suffix}" for word in ("part", "small"))
    do_job(case, small, target, case.joints(SMALL))
    floor(small, target)
    before = peak_mib()
    took = do_job(case, source, target, case.joints(count))
    took["peak"] = peak_mib()
    took["mib"] = took["peak"] - before
    return took | {"floor": floor(source, target)}


def make_files(name: str, count: int, folder: Path) -> int:
    """Writes the small file and the whole one; returns the bytes of the whole one."""
    case, size = CASES[name], 0
    for word, targets in (("small", SMALL), ("part", count)):
        data = case.make(case.robot, case.joints(targets))
        data = data.encode() if isinstance(data, str) else data
        (folder / f"{word}.{case.suffix}").write_bytes(data)
        size = len(data)
    return size


def measured(name: str, count: int, folder: Path) -> dict[str, Any]:
    """Runs a job in a process of its own."""
    command = [sys.executable, __file__, str(count), "--job", name, str(folder)]
    environment = os.environ | dict.fromkeys(THREADS, "1")
    done = subprocess.run(command, stdout=subprocess.PIPE, env=environment, check=True)
    return json.loads(done.stdout)


def report(
    name: str, count: int, size: int, runs: Sequence[dict[str, Any]], best_krl: float
) -> None:
    """Prints the stages, and the speed beside KRL of the same run."""
    stages = {stage: min(run[stage] for run in runs) for stage in ("read", "compensate", "write")}
    ours, least = best_of(runs), min(run["floor"] for run in runs)
    mib, peak = (min(run[key] for run in runs) for key in ("mib", "peak"))
    told = ", ".join(f"{stage} {took:.2f}" for stage, took in stages.items())
    print(
        f"{name}: {size / 1e6:.1f} MB, {runs[0]['compensated']} compensated, {runs[0]['route']}; "
        f"{ours:.2f} CPU-s ({told}), floor {least:.2f}; peak {peak:.0f} MiB"
    )
    rate, reach = count / ours / 1e6, REACH.get(name, OTHERS)
    print(
        f"RESULT | {name}, {count} targets (simulated errors), file to file, M targets per CPU-s; "
        f"CPU time / KRL; / floor; memory, MiB per million targets | - | >= {reach:g} "
        f"| {rate:.3f}; {ours / best_krl:.2f}; {ours / least:.1f}; {mib / count * 1e6:.0f} "
        f"| {'reached' if rate >= reach else 'missed'}"
    )


def best_of(runs: Sequence[dict[str, Any]]) -> float:
    """CPU seconds of the quickest run."""
    return min(run["read"] + run["compensate"] + run["write"] for run in runs)


def main() -> None:
    """Makes the files, runs the jobs in turn, prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="?", type=int, default=200_000)
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--job", nargs=2, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.job:
        json.dump(job(asked.job[0], asked.targets, Path(asked.job[1])), sys.stdout)
        return
    names = list(dict.fromkeys(["krl", *asked.only]))
    with tempfile.TemporaryDirectory() as folder:
        places = {name: Path(folder) / str(k) for k, name in enumerate(names)}
        sizes, runs = {}, {name: [] for name in names}
        for name, place in places.items():
            place.mkdir()
            sizes[name] = make_files(name, asked.targets, place)
        for _ in range(asked.rounds):
            for name, place in places.items():
                runs[name].append(measured(name, asked.targets, place))
    print(f"simulated errors, seed {SEED}, best of {asked.rounds}, load {os.getloadavg()[0]:.1f}")
    for name in names:
        report(name, asked.targets, sizes[name], runs[name], best_of(runs["krl"]))


if __name__ == "__main__":
    main()
