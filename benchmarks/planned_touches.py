"""Planned touches against as many spread ones, on simulated cells.

    python benchmarks/planned_touches.py [--cells N] [--quick]

Cells of robotrue_reproductions.feng2018.machining_cell. 16 features on each touchable face, each in
the attitude its face is machined in, leaned 15 deg to four sides and turned about the tool. The
front and the back are machined; all of the error of 25 points on each counts (rms of a cell; median
over cells).

sides     front, back and top can be touched
one side  front and top can be touched: the back is machined and never probed

The planner is told where the drawing has the block and, of the arm, its type (nominal) or a
tracker calibration of 60 poses (calibrated; planned once, with that of cell 0: another arm of the
type moves the numbers little). ``spread``: always the feature farthest from those taken, in the
attitude of its face. Then the true arm touches, arm and frame are estimated together, and the run
is compensated by that estimate.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from functools import cache
from typing import TypeAlias

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import (
    ProbingSettings,
    before_touching,
    estimate_probing,
    model_of_estimate,
)
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.units import MM
from robotrue.errors import RobotrueError
from robotrue.measurement.formats.part_points import Features
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.probing import Machining, ProbingTask, plan_touches
from robotrue.planning.probing_candidates import touch_candidates
from robotrue.planning.probing_plan import spread_touches
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch
from robotrue_reproductions.feng2018.machining_cell import (
    EDGE,
    FACES,
    SIZE,
    T_BASE_DRAWN,
    FengCell,
    Posture,
    attitude,
    compensated_joints,
    feng_cell,
    machine,
    nominal_joints,
    tracker_poses,
)
from robotrue_reproductions.feng2018.registration_ways import TIP

COUNTS = (6, 10, 20)
MACHINED: tuple[Posture, ...] = ("R", "L")
TOUCHED: dict[str, tuple[Posture, ...]] = {"sides": ("R", "L", "T"), "one side": ("R", "T")}
Found: TypeAlias = dict[tuple[str, str, int, str], list[tuple[float, float]]]
"""Rms error of front and back by arm, sides, touches and way."""
WAYS = ("planned", "spread")
SAID = 25
"""Cells after which what was found so far is printed."""


def grid(face: Posture, count: int) -> Array:
    """Points (count^2, 3) m in part over a face."""
    axis, level = FACES[face]
    free = [k for k in range(3) if k != axis]
    lines = [np.linspace(EDGE, SIZE[k] - EDGE, count) for k in free]
    out = np.empty((count**2, 3))
    out[:, free] = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    out[:, axis] = level
    return out


def outward(face: Posture) -> Array:
    """The face's outward normal in part."""
    axis, level = FACES[face]
    out = np.zeros(3)
    out[axis] = 1.0 if level > 0.0 else -1.0
    return out


@cache
def candidates(sides: str) -> tuple[ProbingSet, Machining]:
    """Candidate touches and machined postures where the drawing has the block."""
    robot = feng_cell(0).nominal
    faces = TOUCHED[sides]
    points = np.concatenate([grid(face, 4) for face in faces])
    access = np.repeat(np.stack([outward(face) for face in faces]), 16, axis=0)
    features = Features(
        names=tuple(f"{face}{k + 1}" for face in faces for k in range(16)),
        point=points,
        normal=np.full_like(points, np.nan),
        access=access,
        part=np.zeros(len(points), dtype=np.int64),
    )
    work = {face: grid(face, 5) for face in MACHINED}
    joints = [
        nominal_joints(robot, _poses(apply(T_BASE_DRAWN, p), attitude(face)), face)
        for face, p in work.items()
    ]
    machining = Machining(
        group=tuple(face for face in work for _ in range(25)),
        point=np.concatenate(list(work.values())),
        joints=np.concatenate(joints),
        part=np.zeros(50, dtype=np.int64),
    )
    return touch_candidates(robot, features, machining, {0: T_BASE_DRAWN}).touches, machining


def _poses(points: Array, rotation: Array) -> Array:
    return pose(np.broadcast_to(rotation, (len(points), 3, 3)), points)


def settings(cell: FengCell, model: ErrorModel) -> ProbingSettings:
    """What planner and estimate are told."""
    return ProbingSettings(
        touch_sigma=cell.sizes.touch,
        tool_sigma=0.0 if model.calibrated else TIP,
        priors=FitSettings(repeatability=cell.sizes.repeatability * RP_PER_SIGMA),
    )


@cache
def calibrated(seed: int) -> ErrorModel:
    """The tracker calibration of a cell."""
    cell = feng_cell(seed)
    told = FitSettings(repeatability=cell.sizes.repeatability * RP_PER_SIGMA)
    measured = tracker_poses(cell, np.random.default_rng([seed, 59]))
    return fit(cell.nominal, measured, method="ripple", settings=told)


@cache
def planned(arm: str, sides: str, n: int) -> IntArray:
    """Rows of the plan."""
    cell = feng_cell(0)
    nominal = NominalModel(robot=cell.nominal)
    return _plan(cell, nominal if arm == "nominal" else calibrated(0), sides, n)


def _plan(cell: FengCell, model: ErrorModel, sides: str, n: int) -> IntArray:
    touches, machining = candidates(sides)
    told = settings(cell, model)
    task = ProbingTask(
        belief=before_touching(model, told),
        T_base_part={0: T_BASE_DRAWN},
        candidates=touches,
        machining=machining,
        touch_sigma=told.touch_sigma,
    )
    return plan_touches(task, n).row


def touched(cell: FengCell, plan: ProbingSet, rng: np.random.Generator) -> ProbingSet:
    """The same touches by the true arm: joints at which its tip is on the true block."""
    robot = cell.nominal
    turn = forward(robot, plan.joints)[:, :3, :3]
    scatter = np.hypot(cell.sizes.touch, cell.sizes.repeatability)
    aim = apply(cell.T_base_part, plan.point) + scatter * rng.normal(size=plan.point.shape)
    shown = aim.copy()
    for _ in range(4):
        joints = inverse_batch(robot, pose(turn, shown), near=plan.joints)
        shown = shown + aim - machine(cell, joints)
    joints = inverse_batch(robot, pose(turn, shown), near=plan.joints)
    kept = np.flatnonzero(~np.isnan(joints).any(axis=1))
    return ProbingSet(
        names=tuple(plan.names[k] for k in kept), point=plan.point[kept], joints=joints[kept]
    )


def machined_rms(cell: FengCell, model: ErrorModel, touches: ProbingSet) -> tuple[float, float]:
    """Rms true error of the front and of the back, m."""
    estimate = estimate_probing(model, touches, settings(cell, model))
    refined = model_of_estimate(estimate)
    out = []
    for face in MACHINED:
        points = grid(face, 5)
        wanted = _poses(apply(estimate.T_base_part[0], points), attitude(face))
        reached = machine(cell, compensated_joints(refined, wanted, face))
        off = apply(inverse(cell.T_base_part), reached) - points
        out.append(float(np.sqrt((off**2).sum(axis=1).mean())))
    return out[0], out[1]


def chosen(way: str, arm: str, sides: str, n: int) -> IntArray:
    """Rows of the candidates that a way takes."""
    if way == "planned":
        return planned(arm, sides, n)
    return spread_touches(candidates(sides)[0], n)


def main(arguments: list[str]) -> None:
    """Runs all cells and prints medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--quick", action="store_true", help="5 cells")
    options = parser.parse_args(arguments)
    cells = 5 if options.quick else options.cells
    print(f"{cells} simulated cells, seeds 0 to {cells - 1}")
    found: Found = defaultdict(list)
    begin = time.process_time()
    for seed in range(cells):
        cell = feng_cell(seed)
        models: dict[str, ErrorModel] = {
            "nominal": NominalModel(robot=cell.nominal),
            "calibrated": calibrated(seed),
        }
        for (arm, model), sides, n, way in _cases(models):
            rows = chosen(way, arm, sides, n)
            plan = candidates(sides)[0].subset(rows)
            touches = touched(cell, plan, np.random.default_rng([seed, 61]))
            try:
                both = machined_rms(cell, model, touches)
            except RobotrueError:  # touches refused: the part stays as drawn
                both = (np.nan, np.nan)
            found[arm, sides, n, way].append(both)
        if (seed + 1) % SAID == 0 and seed + 1 < cells:
            print(f"after {seed + 1} cells")
            report(found)
    report(found)
    results(found)
    print(f"({(time.process_time() - begin) / cells:.2f} CPU-s per cell)")


def _cases(
    models: dict[str, ErrorModel],
) -> list[tuple[tuple[str, ErrorModel], str, int, str]]:
    return [
        (item, sides, n, way)
        for item in models.items()
        for sides in TOUCHED
        for n in COUNTS
        for way in WAYS
    ]


def report(found: Found) -> None:
    """Prints medians with 5 to 95 % over cells."""
    print("rms error over the front and the back, mm: median [5 %, 95 %]; front / back medians")
    for arm, sides, n, way in found:
        table = np.array(found[arm, sides, n, way]) / MM
        both = np.sqrt((table**2).mean(axis=1))
        low, middle, high = np.nanpercentile(both, [5, 50, 95])
        front, back = np.nanmedian(table, axis=0)
        refused = int(np.isnan(both).sum())
        lost = f"  refused {refused}" if refused else ""
        print(
            f"{arm:11s} {sides:9s} {n:3d} {way:8s} {middle:.3f} [{low:.3f}, {high:.3f}]   "
            f"{front:.3f} / {back:.3f}{lost}",
            flush=True,
        )


def results(found: Found) -> None:
    """Prints the rows for the summary."""
    for arm, sides, n in dict.fromkeys(key[:3] for key in found):
        ours, spread = (
            np.sqrt((np.array(found[arm, sides, n, way]) ** 2).mean(axis=1)) / MM for way in WAYS
        )
        better = 100.0 * float(np.nanmean(ours < spread))
        ahead = np.nanmedian(ours) <= np.nanmedian(spread)
        print(
            f"RESULT | {n} touches (simulated), {arm} arm, {sides} touched, median rms mm | spread "
            f"{np.nanmedian(spread):.3f} | below spread | {np.nanmedian(ours):.3f}, better in "
            f"{better:.0f} % of the cells | {'reached' if ahead else 'missed'}"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
