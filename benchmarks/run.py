"""All benchmarks in one run, ending in one table: case | reference | reach | measured | verdict.

    python benchmarks/run.py [--quick] [--only NAME ...]

Every file runs as its own process, with one thread, and prints its seeds; a file that fails gives
rows that say so. The learned model ("gp") stands for ours in the rows on measured arms. Rows with
"simulated" in their case come from a simulation.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
PACKAGES = ("robotrue", "numpy", "scipy", "numba")
OURS = "gp"
CHAIN = {
    "compiled: geometry + compliance, path": ("NumPy prototype 0.15", 0.5),
    "compiled: with ripple 6 x 64 and 500 smooth centres, path": ("-", 0.1),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table."""

    case: str
    reference: str
    reach: str
    measured: str
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """One file: its name, how it is hurried, and how its output is read."""

    name: str
    quick: tuple[str, ...]
    rows: Callable[[str], Iterator[Row]]


def stated(text: str) -> Iterator[Row]:
    """Rows that a file prints itself."""
    for line in text.splitlines():
        if line.startswith("RESULT |"):
            case, reference, reach, measured, verdict = (
                word.strip() for word in line.split("|")[1:]
            )
            yield Row(
                case=case, reference=reference, reach=reach, measured=measured, verdict=verdict
            )


def measured_arms(text: str) -> Iterator[Row]:
    """Rows of real_arms.py: a title line, then one line for each method."""
    case = reference = reach = ""
    for line in text.splitlines():
        title = re.fullmatch(r"(.+?)   reach (.+?)   reference (.+)", line)
        if title:
            case, reach, reference = title.groups()
        ours = re.match(rf"  {OURS} +mean ([\d.]+) mm .*?cover +([\d.]+) %", line)
        if not ours:
            continue
        mean, cover = (float(word) for word in ours.groups())
        bound = [float(word) for word in re.findall(r"[\d.]+", reach)]
        inside = bound[0] <= cover <= bound[1] if "cover" in reach else mean <= bound[0]
        yield Row(
            case=f"{case}, {'coverage of 95 % regions' if 'cover' in reach else 'mean mm'}",
            reference=reference,
            reach=reach,
            measured=f"{cover:.1f} %" if "cover" in reach else f"{mean:.4f}",
            verdict="reached" if inside else "missed",
        )


def chain(text: str) -> Iterator[Row]:
    """Rows of compensation_chain.py: the compiled route on a path."""
    for name, (reference, bound) in CHAIN.items():
        found = re.search(rf"^{re.escape(name)} +([\d.]+) M/s", text, re.MULTILINE)
        if found:
            rate = float(found.group(1))
            yield Row(
                case=f"chain, {name.removeprefix('compiled: ')}, M targets per CPU-s",
                reference=reference,
                reach=f">= {bound}",
                measured=f"{rate:.3f}",
                verdict="reached" if rate >= bound else "missed",
            )


BENCHMARKS = (
    Benchmark(name="start_up", quick=("--quick",), rows=stated),
    Benchmark(name="learners", quick=("--quick",), rows=stated),
    Benchmark(name="constant_attitude", quick=("--quick",), rows=stated),
    Benchmark(name="heavy_arm", quick=("--quick",), rows=stated),
    Benchmark(
        name="heavy_arm_unknown_masses", quick=("--draws", "3", "--cell-arms", "2"), rows=stated
    ),
    Benchmark(name="compensation_chain", quick=("20000",), rows=chain),
    Benchmark(name="program_files", quick=("5000", "--rounds", "1"), rows=stated),
    Benchmark(name="streaming", quick=("100000",), rows=stated),
    Benchmark(name="few_poses", quick=("--quick",), rows=stated),
    Benchmark(name="drifting_frame", quick=("--quick",), rows=stated),
    Benchmark(name="real_arms", quick=("--quick",), rows=measured_arms),
    Benchmark(name="real_touches", quick=("--quick",), rows=stated),
    Benchmark(name="transfer", quick=("--quick", "--rows", "side", "S1A"), rows=stated),
    Benchmark(name="planned_poses", quick=("--quick",), rows=stated),
    Benchmark(name="registration", quick=("--quick",), rows=stated),
    Benchmark(name="registration_coverage", quick=("--quick",), rows=stated),
    Benchmark(name="planned_touches", quick=("--quick",), rows=stated),
    Benchmark(name="drilling", quick=("--quick",), rows=stated),
    Benchmark(name="tool_axis", quick=("--quick",), rows=stated),
    Benchmark(
        name="adversarial_corrections", quick=("--runs", "20", "--seconds", "20"), rows=stated
    ),
    Benchmark(name="rsi_answers", quick=("--cycles", "2000", "--ours", "0"), rows=stated),
)


def machine() -> str:
    """The machine and the versions, one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    return (
        f"{datetime.date.today()}, {os.cpu_count()} cores, {platform.machine()}, "
        f"{platform.system()}, python {platform.python_version()}, {packages}, "
        f"load before the run {load}"
    )


def execute(benchmark: Benchmark, quick: bool) -> list[Row]:
    """Runs one file, shows what it prints, and returns its rows."""
    script = HERE / f"{benchmark.name}.py"
    extra = benchmark.quick if quick else ()
    print(f"\n$ python benchmarks/{benchmark.name}.py {' '.join(extra)}", flush=True)
    failed = Row(case=benchmark.name, reference="-", reach="-", measured="-", verdict="not run")
    if not script.exists():
        return [failed]
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-u", str(script), *extra],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | dict.fromkeys(THREADS, "1"),
    )
    lines = []
    for line in process.stdout or ():
        lines.append(line)
        if not line.startswith("RESULT"):
            print(line, end="", flush=True)
    code = process.wait()
    print(f"({benchmark.name}: {time.perf_counter() - begin:.0f} s)", flush=True)
    rows = list(benchmark.rows("".join(lines)))
    if code or not rows:
        rows.append(failed)
    return rows


def table(rows: list[Row]) -> str:
    """The table as Markdown."""
    head = ("case", "reference", "reach", "measured", "verdict")
    cells = [head, *((r.case, r.reference, r.reach, r.measured, r.verdict) for r in rows)]
    width = [max(len(line[k]) for line in cells) for k in range(len(head))]
    text = [
        "| " + " | ".join(word.ljust(w) for word, w in zip(line, width, strict=True)) + " |"
        for line in cells
    ]
    text.insert(1, "|" + "|".join("-" * (w + 2) for w in width) + "|")
    return "\n".join(text)


def main(arguments: list[str]) -> int:
    names = [benchmark.name for benchmark in BENCHMARKS]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer draws, rows and poses")
    parser.add_argument("--only", nargs="+", choices=names, default=names)
    options = parser.parse_args(arguments)
    print(machine())
    if options.quick:
        print("--quick: a check that everything runs, not the numbers to quote")
    rows: list[Row] = []
    for benchmark in BENCHMARKS:
        if benchmark.name in options.only:
            rows += execute(benchmark, options.quick)
    print(f"\n{machine()}\n\n{table(rows)}")
    return int(any(row.verdict.startswith(("missed", "not run")) for row in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
