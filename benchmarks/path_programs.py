"""G-code, CL data and CSV paths from file to file: targets per CPU-second, beside a floor.

    OMP_NUM_THREADS=1 python benchmarks/path_programs.py [TARGETS]

One file per dialect, every point with its orientation, is read, compensated for a simulated arm
(geometry) and written; one thread, CPU time of the process, best of three. The floor reads the same
bytes, parses each number once, formats each once, and writes.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numba
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))
import cases
from program_files import seconds
from test_path_programs import MAKERS, spin_of, table

from robotrue.compensation import CompensationSettings, compensate
from robotrue.core.files import write_atomic
from robotrue.core.poses import inverse
from robotrue.program.formats import krl_tokens, number_kernels, read_job, write_program
from robotrue.program.program import FrameTable
from robotrue.robot.forward import forward


@numba.njit(cache=True)
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


def floor(source: Path, target: Path) -> None:
    """Reads, parses, formats and writes, and nothing else."""
    buf = np.frombuffer(source.read_bytes(), np.uint8)
    out = np.empty(2 * buf.size, np.uint8)
    write_atomic(target, out[: _reprinted(buf, out)].tobytes())


def whole(source: Path, target: Path, frames: FrameTable, home: Any) -> int:
    """Reads, compensates and writes one file; returns the targets compensated."""
    (program,) = read_job(source, frames)
    result = compensate(
        cases.rigid_model(robot=cases.kr160()), program, settings=CompensationSettings(home=home)
    )
    write_atomic(target, write_program(program, result.replacement))
    return int(result.replacement.changed.sum())


def main() -> None:
    """Prints one row per dialect."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
    joints = cases.path_joints(count)
    T = inverse(cases.FRAME) @ forward(cases.kr160(), joints)
    frames = table(cases.FRAME, spin_of(T))
    print(f"{count} targets per file, simulated errors")
    for name, make in MAKERS.items():
        with tempfile.TemporaryDirectory() as folder:
            small, source = Path(folder) / "small", Path(folder) / "part"
            target = Path(folder) / "out"
            small.write_text(make(T[:300]))
            source.write_text(make(T))
            whole(small, target, frames, joints[0])  # compiles
            floor(small, target)
            done = whole(source, target, frames, joints[0])
            ours = seconds(lambda: whole(source, target, frames, joints[0]))  # noqa: B023
            least = seconds(lambda: floor(source, target))  # noqa: B023
        print(f"{name}: {done} compensated, {ours:.2f} CPU-s, floor {least:.2f} CPU-s")
        print(
            f"RESULT | {name}, {count} targets, file to file, M targets per CPU-second | "
            f"{ours / least:.1f} times the floor | - | {count / ours / 1e6:.3f} | for information |"
        )


if __name__ == "__main__":
    main()
