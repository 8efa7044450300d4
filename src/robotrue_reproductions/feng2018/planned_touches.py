"""Touches planned for the block as drawn, for cutting it from the front and from the back.

The plan knows the arm's type and the drawing and nothing of any cell, so one plan serves all.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import ProbingSettings, before_touching
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.probing import Machining, ProbingTask, plan_touches
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, inverse_batch
from robotrue_reproductions.feng2018.machining_cell import (
    EDGE,
    FACES,
    SIZE,
    START,
    T_BASE_DRAWN,
    CellSizes,
    FengCell,
    Posture,
    attitude,
    feng_cell,
    joints_touching,
    nominal_joints,
)
from robotrue_reproductions.feng2018.slot_experiment import CHECKED

LEANS: Final = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * 15.0 * DEG
"""About tool x and y, of every touch that may be made."""
SPINS: Final = np.array([0.0, 90.0, -90.0, 180.0]) * DEG
"""About the tool's axis."""
GRID: Final = 3
"""Points along each edge of a face."""
TIP: Final = 0.3 * MM
"""m per axis, deviation of a tip from CAD or after a tool change."""


@cache
def plan_block_touches(count: int) -> tuple[tuple[Posture, ...], Array, Array]:
    """Returns postures (n,), part points (n, 3) m and attitudes R_base_tool (n, 3, 3) of a plan.

    Args:
        count: Touches, in the order of their information gain.
    """
    robot = feng_cell(0).nominal
    sizes = CellSizes()
    settings = ProbingSettings(
        touch_sigma=sizes.touch,
        tool_sigma=TIP,
        priors=FitSettings(repeatability=sizes.repeatability * RP_PER_SIGMA),
    )
    posture, points, joints = _candidates()
    names = tuple(str(i + 1) for i in range(len(points)))
    task = ProbingTask(
        belief=before_touching(NominalModel(robot=robot), settings),
        T_base_part={0: T_BASE_DRAWN},
        candidates=ProbingSet(names=names, point=points, joints=joints, source="candidates"),
        machining=_machining(),
        touch_sigma=settings.touch_sigma,
    )
    rows = plan_touches(task, count).row
    chosen = tuple(posture[int(row)] for row in rows)
    return chosen, points[rows], forward(robot, joints[rows])[:, :3, :3]


def touch_planned(cell: FengCell, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Returns part points (n, 3) m and joints (n, 6) rad of the planned touches of a cell."""
    postures, points, turn = plan_block_touches(count)
    scatter = np.hypot(cell.sizes.touch, cell.sizes.repeatability)
    aim = apply(cell.T_base_part, points) + scatter * rng.normal(size=points.shape)
    joints = np.empty((len(points), 6))
    for name in START:
        mine = np.array([p == name for p in postures])
        if mine.any():
            joints[mine] = joints_touching(cell, aim[mine], turn[mine], name)
    return points, joints


def _candidates() -> tuple[list[Posture], Array, Array]:
    """Postures (c,), points (c, 3) m and joints (c, 6) rad of touches that can be made."""
    robot = feng_cell(0).nominal
    lean = matrix_from_rotation_vector(np.pad(LEANS, ((0, 0), (0, 1))))
    spin = matrix_from_rotation_vector(SPINS[:, None] * np.array([0.0, 0.0, 1.0]))
    turns = (lean[:, None] @ spin[None]).reshape(-1, 3, 3)
    names: list[Posture] = []
    points, joints = [], []
    for name, (axis, level) in FACES.items():
        across = [np.linspace(EDGE, edge - EDGE, GRID) for edge in SIZE]
        across[axis] = np.array([level])
        face = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 3)
        where = np.repeat(face, len(turns), axis=0)
        hand = attitude(name) @ np.tile(turns, (len(face), 1, 1))
        start = START[name]
        found = inverse_batch(
            robot,
            pose(hand, apply(T_BASE_DRAWN, where)),
            near=start,
            branch=branch_of(robot, start),
        )
        good = ~np.isnan(found).any(axis=1)
        names += [name] * int(good.sum())
        points.append(where[good])
        joints.append(found[good])
    return names, np.concatenate(points), np.concatenate(joints)


def _machining() -> Machining:
    """Both sides of the block, as they will be cut."""
    robot = feng_cell(0).nominal
    wanted = apply(T_BASE_DRAWN, CHECKED)
    joints, group = [], []
    sides: tuple[tuple[str, Posture], ...] = (("first side", "R"), ("second side", "L"))
    for name, posture in sides:
        turn = np.broadcast_to(attitude(posture), (len(wanted), 3, 3))
        joints.append(nominal_joints(robot, pose(turn, wanted), posture))
        group += [name] * len(wanted)
    return Machining(
        group=tuple(group),
        point=np.tile(CHECKED, (2, 1)),
        joints=np.concatenate(joints),
        part=np.zeros(len(group), dtype=np.int64),
    )
