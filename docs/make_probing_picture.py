r"""Draws docs/_static/probing_uncertainty.png: what machined points will be known to.

    python docs/make_probing_picture.py

A block of 400 x 200 x 400 mm is machined from the front and from the back by a KR160 of which only
the type is known. Features of the front and of the top can be touched, those of the back cannot;
the 20 touches are planned. Nothing is simulated here: these are expected uncertainties.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.calibration.settings import FitSettings, prior_belief
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.units import MM
from robotrue.measurement.formats.part_points import Features
from robotrue.planning.probing import Machining, ProbingTask, plan_touches
from robotrue.planning.probing_candidates import touch_candidates
from robotrue.report.probing_report import part_map
from robotrue_reproductions.feng2018.machining_cell import (
    EDGE,
    FACES,
    SIZE,
    T_BASE_DRAWN,
    Posture,
    attitude,
    feng_cell,
    nominal_joints,
)

OUT: Final = Path(__file__).resolve().parent / "_static" / "probing_uncertainty.png"
TOUCHES: Final = 20
OUTWARD: Final[dict[Posture, tuple[float, float, float]]] = {
    "R": (0.0, -1.0, 0.0),
    "L": (0.0, 1.0, 0.0),
    "T": (0.0, 0.0, 1.0),
}
NAMES: Final[dict[Posture, str]] = {"R": "front", "L": "back", "T": "top"}


def grid(face: Posture, count: int) -> Array:
    """Points (count^2, 3) m in part over a face."""
    axis, level = FACES[face]
    free = [k for k in range(3) if k != axis]
    lines = [np.linspace(EDGE, SIZE[k] - EDGE, count) for k in free]
    out = np.full((count**2, 3), level)
    out[:, free] = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    return out


def main() -> None:
    """Plans, prints the expected uncertainty, and writes the picture."""
    robot = feng_cell(0).nominal
    machined: tuple[Posture, ...] = ("R", "L")
    touched: tuple[Posture, ...] = ("R", "T")
    work = {face: grid(face, 9) for face in machined}
    joints = []
    for face, points in work.items():
        turn = np.broadcast_to(attitude(face), (len(points), 3, 3))
        joints.append(nominal_joints(robot, pose(turn, apply(T_BASE_DRAWN, points)), face))
    machining = Machining(
        group=tuple(NAMES[face] for face in machined for _ in work[face]),
        point=np.concatenate(list(work.values())),
        joints=np.concatenate(joints),
        part=np.zeros(sum(map(len, work.values())), dtype=np.int64),
    )
    points = np.concatenate([grid(face, 4) for face in touched])
    features = Features(
        names=tuple(f"{NAMES[face]} {k + 1}" for face in touched for k in range(16)),
        point=points,
        normal=np.full_like(points, np.nan),
        access=np.repeat([OUTWARD[face] for face in touched], 16, axis=0),
        part=np.zeros(len(points), dtype=np.int64),
    )
    candidates = touch_candidates(robot, features, machining, {0: T_BASE_DRAWN})
    task = ProbingTask(
        belief=prior_belief(robot, FitSettings(scales=PriorScales(tool=0.3 * MM))),
        T_base_part={0: T_BASE_DRAWN},
        candidates=candidates.touches,
        machining=machining,
        touch_sigma=0.1 * MM,
    )
    plan = plan_touches(task, TOUCHES)
    sys.stdout.write(
        f"{TOUCHES} touches on {' and '.join(NAMES[face] for face in touched)}, expected rms of "
        f"all machined points: planned {plan.mean[-1] / MM:.3f} mm, spread over the same faces "
        f"{plan.spread_mean[-1] / MM:.3f} mm\n"
    )
    OUT.write_bytes(part_map(plan, task, np.array([0.0, 0.0, 1.0])).png())


if __name__ == "__main__":
    main()
