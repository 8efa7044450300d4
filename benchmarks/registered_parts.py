"""What `robotrue register` is worth: parts machined in the frame each of its ways finds.

    python benchmarks/registered_parts.py [--cells N] [--quick]

Simulated cells of robotrue_reproductions.feng2018.machining_cell (touch .1 mm per axis, tip off by
.3 mm per axis). A nominal arm touches the block from one side or three; a calibrated one (60
tracker poses, method "elastic") touches 30 points of three sides, before and after a tool change of
.3 mm per axis. Points of the front and of the back, 12 each, are then machined in the frame, by the
model it belongs to. The last rows exchange the models of probing and run.

Columns: median over cells of the rms error, in brackets its 95th percentile, mm; stated: the
largest 95 % region of a machined point at the touches, median; share of cells with verdict GO;
refused: cells in which the touches contradict the model, so that no frame is given.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from itertools import product
from typing import Literal

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings
from robotrue.core.poses import apply, pose
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.model import RobotModel
from robotrue.validation.part_registration import register
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue_reproductions.feng2018.machining_cell import (
    FengCell,
    Posture,
    attitude,
    compensated_joints,
    feng_cell,
    machine,
    touch,
    touch_points,
    tracker_poses,
    with_tool_change,
)

ARM = FitSettings(repeatability=0.03 * MM * RP_PER_SIGMA)
FIRST_SEED = 0
WAYS: tuple[Literal["frame", "joint"], ...] = ("frame", "joint")
CUT: tuple[Posture, ...] = ("R", "L")
PLANS: dict[str, dict[Posture, int]] = {
    "6 front": {"R": 6},
    "10 front": {"R": 10},
    "20 front": {"R": 20},
    "9 of three sides": {"R": 3, "L": 3, "T": 3},
    "12 of three sides": {"R": 4, "L": 4, "T": 4},
    "20 of three sides": {"R": 7, "L": 7, "T": 6},
    "30 of three sides": {"R": 10, "L": 10, "T": 10},
}


def probed(cell: FengCell, plan: dict[Posture, int], rng: np.random.Generator) -> ProbingSet:
    points = {side: touch_points(side, n, rng) for side, n in plan.items()}
    joints = [touch(cell, points[side], side, rng) for side in plan]
    names = tuple(f"{side}{i}" for side, n in plan.items() for i in range(n))
    return ProbingSet(names=names, point=np.vstack(list(points.values())), joints=np.vstack(joints))


def machined(
    cell: FengCell,
    found: RegisteredPart,
    run: ErrorModel | RobotModel,
    side: Posture,
    rng: np.random.Generator,
) -> float:
    """Rms error, mm, of 12 points of a face in the frame, run by a model."""
    points = touch_points(side, 12, rng)
    place = apply(found.frames[0].registration.T_base_part, points)
    wanted = pose(np.broadcast_to(attitude(side), (12, 3, 3)), place)
    hit = machine(cell, compensated_joints(run, wanted, side), rng)
    off = hit - apply(cell.T_base_part, points)
    return float(np.sqrt((off**2).sum(axis=1).mean())) / MM


def row(
    cell: FengCell,
    arm: ErrorModel | RobotModel,
    touches: ProbingSet,
    settings: RegistrationSettings,
    rng: np.random.Generator,
    run: ErrorModel | RobotModel | None = None,
) -> list[float]:
    try:
        model = NominalModel(robot=arm) if isinstance(arm, RobotModel) else arm
        found = register(model, touches, settings=settings)
    except ImplausibleDataError:
        return [np.nan] * 4
    errors = [machined(cell, found, run or found.refined or arm, side, rng) for side in CUT]
    return [*errors, found.frames[0].region.max() / MM, float(found.verdict == "GO")]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--quick", action="store_true", help="20 cells")
    given = parser.parse_args()
    cells = 20 if given.quick else given.cells
    started = time.perf_counter()
    rows: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for seed in range(FIRST_SEED, FIRST_SEED + cells):
        cell, rng = feng_cell(seed), np.random.default_rng([seed, 9])
        for plan, sides in PLANS.items():
            touches = probed(cell, sides, rng)
            for way in WAYS:
                told = RegistrationSettings(arm=ARM, fit=way)
                rows[f"nominal, {plan}", way].append(row(cell, cell.nominal, touches, told, rng))
        model = fit(cell.nominal, tracker_poses(cell, rng), method="elastic", settings=ARM)
        changed = with_tool_change(cell, rng)
        for what, at, sigma in (("calibrated", cell, None), ("tool changed", changed, 0.3 * MM)):
            touches = probed(at, PLANS["30 of three sides"], rng)
            for way in WAYS:
                told = RegistrationSettings(arm=ARM, fit=way, tool_sigma=sigma)
                rows[f"{what}, 30 of three sides", way].append(row(at, model, touches, told, rng))
        touches = probed(cell, PLANS["20 front"], rng)
        told = RegistrationSettings(arm=ARM, fit="frame")
        arms: dict[str, ErrorModel | RobotModel] = {"nominal": cell.nominal, "calibrated": model}
        for (by, arm), (then, run) in product(arms.items(), repeat=2):
            what = f"20 front by {by}, run by {then}"
            rows[what, "frame"].append(row(cell, arm, touches, told, rng, run))
    sys.stdout.write(f"{cells} cells, seeds from {FIRST_SEED}; simulated\n")
    sys.stdout.write(f"{'touches':40} {'way':6} {'front':>16} {'back':>16} stated    GO refused\n")
    for (what, route), found in rows.items():
        table = np.array(found)
        kept = table[np.isfinite(table[:, 0])]
        middle, high = np.median(kept, axis=0), np.percentile(kept, 95, axis=0)
        errors = [f"{middle[k]:6.3f} [{high[k]:6.3f}]" for k in (0, 1)]
        sys.stdout.write(
            f"{what:40} {route:6} {errors[0]:>16} {errors[1]:>16} {middle[2]:6.3f} "
            f"{kept[:, 3].mean():5.2f} {len(table) - len(kept):7d}\n"
        )
    sys.stdout.write(f"{time.perf_counter() - started:.0f} s\n")


if __name__ == "__main__":
    main()
