"""What calibrating costs: processor seconds of whole commands beside one Cholesky of their size.

    python benchmarks/calibration_cost.py [--quick]

Fresh processes, one thread, compiled kernels warm. Measured arms: the UR5's 1,000 grid poses
(points), 505 full poses of the UR10's series B and 2,218 of its series A, evenly spaced. ``auto``
prints what it chose and its held-out error, so that no speed is bought with accuracy. The last
column is the time of one Cholesky decomposition of as many columns as the model keeps: the floor of
one step of learning.
Data: the folder ROBOTRUE_DATA (default ../shared/data).
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.linalg.lapack import dpotrf

ROOT = Path(os.environ.get("ROBOTRUE_DATA", Path(__file__).parents[2] / "shared" / "data"))
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
RUN = "import sys; from robotrue.cli.main import run; sys.exit(run())"
CELL = """schema = 1
[robot]
preset = "{robot}"
[tool]
xyz_mm = [0.0, 0.0, {z}]
[target]
xyz_mm = [0.0, 0.0, {z}]
[tracker]
frame = "unknown"
[repeatability]
mm = 0.03
"""
ARMS = {
    "UR5": ("UR5", "ur5-jacobi/3D_UR5_uncalibrated_grid_cleaned.csv", 31.0),
    "UR10": ("UR10", "ur10-landgraf/Series_B/measurements_joint_configurations.csv", 93.1),
    "UR10 A": ("UR10", "ur10-landgraf/Series_A/measurements_grid.csv", 109.0),
}
"""Preset, file and mm from the flange to the reflector."""
CASES = (
    ("UR10", 60, "elastic"),
    ("UR10", 60, "auto"),
    ("UR10", 505, "auto"),
    ("UR5", 1000, "auto"),
    ("UR10 A", 2218, "auto"),
)
QUICK = 2


def cut_rows(source: Path, count: int, target: Path) -> None:
    """Writes the header and ``count`` evenly spaced rows of a text file."""
    header, *rows = source.read_text().splitlines()
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows))).round().astype(int)
    target.write_text("\n".join([header, *(rows[k] for k in chosen)]) + "\n")


def run_command(arguments: list[str]) -> tuple[dict[str, object], float]:
    """Returns the JSON result of a command and its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    done = subprocess.run(
        [sys.executable, "-c", RUN, *arguments, "--json"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(done.stdout), used


def time_cholesky(size: int) -> float:
    """Returns processor seconds of one Cholesky decomposition of a (size, size) matrix."""
    matrix = np.full((size, size), 0.5) + 0.5 * np.eye(size)
    begin = os.times()
    dpotrf(matrix.T, lower=1)
    end = os.times()
    return end.user + end.system - begin.user - begin.system


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the small cases alone")
    quick = parser.parse_args().quick
    for name in THREADS:
        os.environ[name] = "1"
    if not ROOT.is_dir():
        raise SystemExit(f"no measured data at {ROOT}: set ROBOTRUE_DATA")
    print(f"{'arm':6}{'rows':>6}  {'method':9}{'CPU s':>8}  {'used':10}{'held out mm':>12}"
          f"{'covered':>9}{'columns':>9}{'Cholesky s':>12}")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for arm, count, method in CASES[: QUICK if quick else None]:
            robot, source, z = ARMS[arm]
            cell, rows, model = (
                Path(folder) / name for name in ("cell.toml", f"{arm}.csv", "m.robotrue")
            )
            cell.write_text(CELL.format(robot=robot, z=z))
            cut_rows(ROOT / source, count, rows)
            told, used = run_command(
                ["calibrate", str(cell), str(rows), "--method", method, "-o", str(model)]
            )
            print_row(arm, count, method, told, used)


def print_row(arm: str, count: int, method: str, told: dict[str, object], used: float) -> None:
    """Prints one line of the table."""
    selection, chosen = told.get("selection"), str(told["method"])
    error, covered = float("nan"), float("nan")
    if isinstance(selection, dict):
        chosen = str(selection["winner"])
        score = next(row for row in selection["table"] if row["name"] == chosen)
        error, covered = 1e3 * score["mean"], score["coverage"]
    determined, parameters = told.get("determined"), told["parameters"]
    columns = len(parameters) if isinstance(parameters, dict) else 0
    if isinstance(determined, dict):  # two columns for each harmonic of each band in use
        for name in determined:
            if name.startswith("ripple/"):
                low, high = map(int, name.rsplit("/", 1)[1].split("-"))
                columns += 2 * (high - low + 1)
    print(f"{arm:6}{count:6d}  {method:9}{used:8.1f}  {chosen:10}{error:12.4f}{covered:9.3f}"
          f"{columns:9d}{time_cholesky(columns):12.4f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
