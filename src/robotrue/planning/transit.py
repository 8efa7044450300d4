"""Moves from one side of a part to the next that keep the arm clear of part and obstacles.

Joint moves (all axes together, straight in joint space) are tried in a fixed order, the first that
is clear is taken:

1. straight to the next posture;
2. drawn in: shoulder and elbow as at home, then axis 1 and the wrist, then out again; then the
   same with the arm drawn further in (:data:`DRAWN`);
3. over home, drawn in before and after.

Clear means: no tube of the arm or tool (:mod:`robotrue.planning.arm_scene`) comes into the box
around the part or nearer than the clearance to an obstacle, at postures not more than 2 deg apart.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.obstacles import Box
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import apply, inverse
from robotrue.core.units import DEG, MM
from robotrue.errors import ReachError
from robotrue.planning.arm_scene import Scene, collisions, scene_of, to_obstacle
from robotrue.robot.makers import joints_of_posture

FINE: Final = 2.0 * DEG
CLEARANCE: Final = 10.0 * MM
"""Kept from obstacles and of the arm from itself."""
DRAWN: Final = np.array([-120.0, 90.0]) * DEG
"""rad, A2 and A3 of a KUKA arm drawn in: the upper arm leans back, the forearm rises."""


def scene_without_reflector(cell: Cell) -> Scene:
    """Returns the scene of a cell that machines: no reflector on the flange, no tracker about."""
    bare = replace(
        cell,
        T_flange_target=cell.robot.T_flange_tool,
        tracker_position=None,
        tracker_place=None,
        frame="base",
    )
    return scene_of(bare, clearance=CLEARANCE)


def find_collisions(
    scene: Scene, box: Box, T_base_part: Array, joints: Array
) -> dict[str, BoolArray]:
    """Returns, per reason, which postures (n, 6) rad run into something.

    Args:
        scene: Arm and obstacles.
        box: Around the part, in the part frame.
        T_base_part: (4, 4) frame of the part.
        joints: (n, 6) rad.
    """
    out = collisions(scene, joints)
    axes, _, _ = scene.tubes(joints)
    moving = apply(inverse(T_base_part), axes[:, 1:])
    out["collision with the part"] = np.asarray(
        (to_obstacle(moving, box) < scene.radius[1:]).any(axis=1)
    )
    return out


def transit(
    scene: Scene, box: Box, T_base_part: Array, start: Array, end: Array, home: Array, *, what: str
) -> Array:
    """Returns postures (k, 6) rad between two others, by the rule in the head of this module.

    Empty if the joint move goes straight from one to the other.

    Args:
        scene: Arm and obstacles.
        box: Around the part, in the part frame.
        T_base_part: (4, 4) frame of the part.
        start: (6,) rad.
        end: (6,) rad.
        home: (6,) rad.
        what: Names the move in the message.

    Raises:
        ReachError: None of them is clear.
    """
    near, far = (_draw_in(start, end, shape) for shape in (home[1:3], _drawn_shape(scene)))
    fault = ""
    for between in ([], near, far, [home], [near[0], home, near[1]], [far[0], home, far[1]]):
        way = _sample_moves(np.array([start, *between, end]))
        hits = find_collisions(scene, box, T_base_part, way)
        found = [reason for reason, hit in hits.items() if hit.any()]
        if not found:
            moved = [q for q in between if not (np.array_equal(q, start) or np.array_equal(q, end))]
            return np.array(moved).reshape(-1, 6)
        fault = fault or found[0]
    raise ReachError(
        f"no way {what} is clear: {fault}. Tried straight, drawn in, and over home.",
        hint="another --home-deg, a larger --lift-mm, or check part frame, tool and obstacles.",
    )


def _draw_in(start: Array, end: Array, shape: Array) -> list[Array]:
    """Both postures with the shoulder and elbow of another."""
    return [np.concatenate([q[:1], shape, q[3:]]) for q in (start, end)]


def _drawn_shape(scene: Scene) -> Array:
    axes = np.concatenate([[0.0], DRAWN, np.zeros(3)])
    return joints_of_posture(scene.cell.robot, axes)[1:3]


def _sample_moves(postures: Array) -> Array:
    """Postures along joint moves, at most 2 deg apart."""
    out = [postures[:1]]
    for start, end in pairwise(postures):
        count = max(int(np.ceil(np.abs(end - start).max() / FINE)), 1)
        share = np.arange(1, count + 1)[:, None] / count
        out.append(start + share * (end - start))
    return np.concatenate(out)
