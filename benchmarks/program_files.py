"""KRL programs from file to file: targets per CPU-second, beside a floor of the same bytes.

    OMP_NUM_THREADS=1 python benchmarks/program_files.py [TARGETS]

One file of LIN targets with six numbers of four decimals each is read, compensated for a simulated
arm (geometry and compliance), and written; one thread, CPU time of the process, best of five, the
stages and the floor in turn. The floor reads the same bytes, parses each number once, formats each
once with its four decimals, and writes: one pass from buffer to buffer with the product's own
kernels for a number, nothing found out about lines, nothing kept, no matrix made of A, B, C and
none taken apart. Peak memory is that of a process of its own that does the whole job once.
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))
import cases

from robotrue.compensation import CompensationSettings, compensate
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.files import write_atomic
from robotrue.core.poses import pose
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.formats import krl_tokens, number_kernels, read_job, write_program
from robotrue.robot.forward import forward

SEED = 3
REACH = 0.25
FLOORS = 3.0
ROUNDS = 5


def program_text(count: int) -> bytes:
    """Returns a program along a smooth path of the arm, about 70 bytes a target."""
    model = cases.rigid_model(SEED)
    T = forward(model.robot, cases.path_joints(count))
    tool = model.robot.T_flange_tool
    numbers = np.hstack([T[:, :3, 3] / MM, abc_from_matrix(T[:, :3, :3]) / DEG])
    aggregate = "{X %.4f,Y %.4f,Z %.4f,A %.4f,B %.4f,C %.4f}"
    of_tool = (*(tool[:3, 3] / MM), *(abc_from_matrix(tool[:3, :3]) / DEG))
    head = "DEF part()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL="
    head += aggregate.replace(".4f", ".9f") % of_tool
    lines = "".join(f"LIN {aggregate % tuple(row)} C_DIS\n" for row in numbers.tolist())
    return f"{head}\n{lines}END\n".encode()


def whole(source: Path, target: Path, count: int) -> dict[str, float]:
    """Reads, compensates and writes one file; returns the CPU seconds of each stage."""
    settings = CompensationSettings(home=cases.path_joints(count)[0])
    model = cases.rigid_model(SEED)
    times = [time.process_time()]
    (program,) = read_job(source)
    times.append(time.process_time())
    result = compensate(model, _with_measured_tool(program, model), settings=settings)
    times.append(time.process_time())
    write_atomic(target, write_program(program, result.replacement))
    times.append(time.process_time())
    return dict(zip(("read", "compensate", "write"), np.diff(times).tolist(), strict=True))


def _with_measured_tool(program: Any, model: Any) -> Any:
    """The tool to all digits: printed ones would make it another tool than the measured one."""
    tools = pose(model.robot.T_flange_tool[:3, :3], model.robot.T_flange_tool[:3, 3])[None]
    names = {name: getattr(program, name) for name in type(program).__dataclass_fields__}
    return type(program)(
        **(names | {"T_flange_tool": np.repeat(tools, len(program.T_flange_tool), 0)})
    )


@compile_kernel(PLAIN)
def _reprinted(buf: Any, out: Any) -> Any:
    """Copies the bytes with every number parsed and formatted once; returns the size."""
    i, k, n = 0, 0, buf.size
    while i < n:
        c = buf[i]
        if (48 <= c <= 57 or c == 45) and i > 0 and buf[i - 1] == 32:
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
    start = time.process_time()
    buf = np.frombuffer(source.read_bytes(), np.uint8)
    out = np.empty(2 * buf.size, np.uint8)
    size = _reprinted(buf, out)
    write_atomic(target, out[:size].tobytes())
    return time.process_time() - start


def seconds(task: Callable[[], None]) -> float:
    """CPU seconds of a task, best of three."""
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        task()
        best = min(best, time.process_time() - start)
    return best


def _peak(source: Path, target: Path, count: int, out: Any) -> None:
    before = _highest()
    whole(source, target, count)
    out.put((before, _highest()))


def _highest() -> int:
    """Largest resident size of this process so far, kB; 0 where the system does not say."""
    status = Path("/proc/self/status")
    words = status.read_text().split() if status.is_file() else []
    return int(words[words.index("VmHWM:") + 1]) if "VmHWM:" in words else 0


def main() -> None:
    """Prints the speed, the floor and the memory."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    with tempfile.TemporaryDirectory() as folder:
        small, source = Path(folder) / "small.src", Path(folder) / "part.src"
        target = Path(folder) / "out.src"
        small.write_bytes(program_text(300))
        source.write_bytes(program_text(count))
        whole(small, target, 300)  # compiles
        floor(small, target)
        runs, least = [], np.inf
        for _ in range(ROUNDS):
            runs.append(whole(source, target, count))
            least = min(least, floor(source, target))
        best = {stage: min(run[stage] for run in runs) for stage in runs[0]}
        ours = min(sum(run.values()) for run in runs)
        queue = multiprocessing.get_context("spawn").Queue()
        child = multiprocessing.get_context("spawn").Process(
            target=_peak, args=(source, target, count, queue)
        )
        child.start()
        base, peak = queue.get()
        child.join()
        size = source.stat().st_size
    rate, ratio = count / ours / 1e6, ours / least
    files = (best["read"] + best["write"]) / least
    print(f"{count} targets, {size / 1e6:.0f} MB, simulated errors, seed {SEED}")
    stages = ", ".join(f"{stage} {took:.2f}" for stage, took in best.items())
    print(f"file to file {ours:.2f} CPU-s ({stages}), floor {least:.2f}, best of {ROUNDS}")
    print(f"peak memory {peak / 1024:.0f} MiB")
    print(
        f"RESULT | KRL, {count} targets, file to file, M targets per CPU-second | prototype 0.15 "
        f"| >= {REACH} | {rate:.3f} | {'reached' if rate >= REACH else 'missed'}"
    )
    print(
        f"RESULT | the same, times the floor (bytes, each number parsed and formatted once) | - "
        f"| <= {FLOORS:g} | {ratio:.1f} | {'reached' if ratio <= FLOORS else 'missed'}"
    )
    print(
        f"RESULT | reading and writing alone, times the floor | - | <= {FLOORS:g} | {files:.1f} "
        f"| {'reached' if files <= FLOORS else 'missed'}"
    )
    print(
        f"RESULT | the same, peak memory beyond the imports | - | 1 GiB for 10 M targets "
        f"| {(peak - base) / 1024:.0f} MiB | for information |"
    )


if __name__ == "__main__":
    main()
