"""Lines and arcs between compensated targets: how far they are off, and what splitting takes.

    OMP_NUM_THREADS=1 python benchmarks/split_moves.py [--arms 40] [--moves 1000000]

SIMULATED arms: the KR160 preset, tool 200 mm out, every Denavit-Hartenberg parameter off by 0.3 mm
or 0.02 deg (one sigma), drive stiffness of Deng et al. 2022; seeds 0 to 39, the same moves in the
middle of the working space. Printed are medians and quartiles over the arms in um beside the one
arm of the project's notes, and the parts that bring the median arm under 2 um. Then the time of the
report on a million lines of 0.6 mm beside one compensation of the same program: CPU seconds of one
thread, in one run.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))
import cases

from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.split_deviation import job_deviation, measure_moves
from robotrue.compensation.split_shapes import JobMoves, job_moves
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.program.insertion import Moves
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice

TOOL: Final = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0.2], [0, 0, 0, 1.0]])
HOME: Final = np.array([0, -30, -30, 5, 90, 10]) * DEG
STIFFNESS: Final = 1e6 * np.array([1.75, 1.72, 1.95, 0.73, 0.51, 0.44])
FORCE: Final = 300.0
TOLERANCE: Final = 2.0 * UM


class Move(NamedTuple):
    """A move around the middle: an arc of an angle, or a line; the notes' deviation in um."""

    size_mm: float
    angle: float
    note: str
    force: float = 0.0


MOVES: Final = (
    Move(5, np.pi, "1.6"), Move(25, np.pi, "7.8"), Move(100, np.pi, "26.9"),
    Move(200, np.pi, "41.8"), Move(400, np.pi / 2, "5.0"),
    Move(5, np.pi, "62-76", FORCE), Move(25, np.pi, "62-76", FORCE),
    Move(100, np.pi, "62-76", FORCE), Move(200, np.pi, "62-76", FORCE),
    Move(10, 0, "0.01"), Move(50, 0, "0.19"), Move(100, 0, "0.75"), Move(300, 0, "6.75"),
    Move(600, 0, "26.9"),
)  # fmt: skip


def arm(seed: int) -> cases.TableModel:
    """Returns a simulated arm as its own exact model."""
    robot = cases.kr160(TOOL)
    rng, errors = np.random.default_rng(seed), np.zeros(robot.errors.shape)
    for group, sd in (
        ("theta", 0.02 * DEG), ("alpha", 0.02 * DEG), ("d", 0.3 * MM), ("a", 0.3 * MM)
    ):  # fmt: skip
        part = parameter_slice(robot.dof, group)
        errors[part] = rng.normal(size=errors[part].shape) * sd
    errors[parameter_slice(robot.dof, "compliance")] = 1.0 / STIFFNESS
    return cases.TableModel(tables=rigid_tables(robot.with_errors(errors)))


def targets(move: Move) -> tuple[Array, Array]:
    """Returns targets (k, 4, 4) in the base and the force (k, 6) N on them."""
    size = move.size_mm * MM
    if move.angle:
        angle = np.array([0.0, 0.5, 1.0]) * move.angle
        # An arc of 90 deg is put with its chord in the middle, not its centre.
        middle = np.array([np.cos(0.5 * move.angle), np.sin(0.5 * move.angle), 0.0])
        place = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        place = size * (place - (middle if move.angle < 3.0 else 0.0))
        wrench = np.zeros((3, 6))
        wrench[:, 0], wrench[:, 1] = -move.force * np.sin(angle), move.force * np.cos(angle)
    else:
        place, wrench = np.array([[0, -0.5, 0], [0, 0.5, 0]]) * size, np.zeros((2, 6))
    T = np.tile(forward(cases.kr160(TOOL), HOME[None])[0], (len(place), 1, 1))
    T[:, :3, 3] += place
    return T, wrench


def job_of(model: cases.TableModel, T: Array, wrench: Array, *, arc: bool) -> JobMoves:
    """Returns a compensated job of one arc, or of lines from target to target."""
    n = len(T)
    settings = CompensationSettings(home=HOME, wrench=wrench if wrench.any() else np.empty(0))
    program = cases.program_of(T, tool=TOOL)
    result = compensate(model, program, settings=settings)
    if not (result.status == Status.COMPENSATED).all():
        raise SystemExit(f"not all targets can be compensated: {result.counts()}")
    count = 1 if arc else n - 1
    moves = Moves(
        start=np.arange(count),
        via=np.full(count, 1 if arc else -1),
        end=np.arange(count) + (2 if arc else 1),
        line=np.arange(count) + 1,
        obstacle=np.zeros(count, dtype=np.int64),
    )
    return job_moves(model, [program], moves, [result], [settings])


def fewest(jobs: list[JobMoves]) -> tuple[int, float]:
    """Returns the parts at which the median arm is under the tolerance, and what it has then."""
    for parts in range(1, 40):
        size = [measure_moves(job, np.zeros(1, int), np.full(1, parts)).size[0] for job in jobs]
        if np.median(size) <= TOLERANCE:
            return parts, float(np.median(size))
    return 0, np.nan


def table(arms: int) -> None:
    """Prints every move."""
    models = [arm(seed) for seed in range(arms)]
    error = []
    print(f"SIMULATED, {arms} arms, seeds 0 to {arms - 1}; um off the compensated path")
    print(
        "move                        median   quartiles        one arm of the notes  parts at 2 um"
    )
    for move in MOVES:
        jobs = [job_of(model, *targets(move), arc=bool(move.angle)) for model in models]
        size = np.array([job_deviation(job).size[0] for job in jobs]) / UM
        low, middle, high = np.percentile(size, [25, 50, 75])
        parts, left = fewest(jobs)
        what = f"line {move.size_mm:g} mm"
        if move.angle:
            what = f"arc r {move.size_mm:g} mm, {move.angle / DEG:.0f} deg"
            what += f", {move.force:g} N" if move.force else ""
        print(
            f"{what:26s} {middle:8.3f}   {low:7.3f} to {high:7.3f}   {move.note:>10s}   "
            f"        {parts:3d} ({left / UM:.2f} um)"
        )
    for model in models:
        T, _ = targets(MOVES[0])
        found = compensate(
            model, cases.program_of(T, tool=TOOL), settings=CompensationSettings(home=HOME)
        )
        error.append(np.linalg.norm(found.predicted_error_before[0]))
    print(f"error of these arms there: {np.median(error) / MM:.2f} mm median")


def report(count: int) -> None:
    """Prints what the report on short lines costs beside one compensation of them."""
    across = 200
    i = np.arange(count)
    row, column = i // across, i % across
    column = np.where(row % 2 == 0, column, across - 1 - column)
    place = np.stack([column / across - 0.5, (row % across) / across - 0.5, 0.0 * i], axis=1) * 0.12
    T = np.tile(forward(cases.kr160(TOOL), HOME[None])[0], (count, 1, 1))
    T[:, :3, 3] += place
    model = arm(0)
    job_deviation(job_of(model, T[:5000], np.zeros((5000, 6)), arc=False))  # compiles
    program = cases.program_of(T, tool=TOOL)
    start = time.process_time()
    compensate(model, program, settings=CompensationSettings(home=HOME))
    once = time.process_time() - start
    job = job_of(model, T, np.zeros((count, 6)), arc=False)
    start = time.process_time()
    found = job_deviation(job)
    report_time = time.process_time() - start
    print(
        f"{count} lines of 0.6 mm: one compensation {once:.2f} CPU s, report {report_time:.2f} "
        f"CPU s, {report_time / once:.2f} times; {found.bounded.mean():.1%} proven short, "
        f"worst {np.nanmax(found.size) / UM:.2f} um"
    )


def main() -> None:
    """Prints both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=40)
    parser.add_argument("--moves", type=int, default=1_000_000)
    given = parser.parse_args()
    table(given.arms)
    report(given.moves)


if __name__ == "__main__":
    main()
