"""The arm as simple bodies to draw, and where they are in its postures.

Drawn, not computed with: collision and line of sight are the business of ``planning.scene``.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.app.workbench.arm_shapes import arm_shapes, link_poses
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.json_values import json_values
from robotrue.core.poses import pose
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.planning.arm_scene import THICK, THIN
from robotrue.robot.forward import walk, wrist_reach
from robotrue.robot.model import RobotModel

POSTURES: Final = 2000
"""From which the one of an arm without measured poses is chosen."""
IN_FRONT: Final = (0.5, 0.0, 0.35)
"""Tool point there, over the reach."""
TAPER_AT: Final = (0.0, 0.4, 0.6, 1.0)
"""Links from the first to the last, 0 to 1."""
TAPER: Final = (1.15 * THICK, THICK, THIN, 0.8 * THIN)
"""Radius there over the reach."""


def body_document(cell: Cell, joints: Array) -> dict[str, object]:
    """Returns the bodies of the arm and where they are in n postures.

    ``shapes`` in the frames of their links, ``links`` (n, dof + 1, 4, 3) m origin and axes of base
    and links, ``tool`` (n, 4, 3) those of the tool point;
    ``wrist_reach_m`` as data sheets state it, ``reach_m`` what no posture exceeds, tool included.
    """
    robot = cell.robot.nominal()
    state = walk(robot, joints)
    return {
        "shapes": [shape.document() for shape in arm_shapes(robot, _radius(cell))],
        "links": pack_floats(_columns_of(link_poses(state))),
        "tool": pack_floats(_columns_of(pose(state.rotation, state.position))),
        "orientation": orientations(state.rotation),
        "reach_m": float(robot.reach),
        "wrist_reach_m": wrist_reach(robot),
        "name": robot.name,
        "dof": robot.dof,
    }


def choose_posture(robot: RobotModel) -> Array:
    """Returns joints (dof,) rad in which an arm without measured poses is drawn.

    Of some postures within the middle half of its limits the one that holds the tool in front of
    the base, keeps the links above the floor, and turns its joints least.
    """
    robot = robot.nominal()
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    share = np.random.default_rng(0).uniform(0.25, 0.75, (POSTURES, robot.dof))
    joints = low + share * (high - low)
    state = walk(robot, joints)
    miss = np.linalg.norm(state.position - np.array(IN_FRONT) * robot.reach, axis=1)
    sunk = np.maximum(0.0, 0.1 * robot.reach - state.link_position[..., 2]).sum(axis=1)
    turned = np.abs(share - 0.5).mean(axis=1) * robot.reach
    return np.asarray(joints[np.argmin(miss + sunk + turned)])


def _columns_of(T: Array) -> Array:
    """Origin and axes (..., 4, 3) of poses (..., 4, 4)."""
    return np.concatenate([T[..., None, :3, 3], np.swapaxes(T[..., :3, :3], -1, -2)], axis=-2)


def orientations(rotation: Array) -> dict[str, object]:
    """Returns rotations (n, 3, 3) for a script, as each controller prints them."""
    return {name: pack_floats(numbers) for name, numbers in controller_angles(rotation).items()}


def controller_angles(rotation: Array) -> dict[str, Array]:
    """Returns rotations (n, 3, 3) as the numbers (n, 3 or 4) that each controller prints."""
    abc = np.degrees(abc_from_matrix(rotation))
    return {
        "kuka": abc,
        "fanuc": abc[:, ::-1],
        "abb": quat_wxyz_from_matrix(rotation),
        "ur": rotation_vector_from_matrix(rotation),
    }


def _radius(cell: Cell) -> Array:
    """Radius (dof,) m of the links to draw: as stated, else by the reach, thinner to the flange."""
    if cell.link_radius is not None:
        return np.asarray(cell.link_radius)
    taper = np.interp(np.linspace(0.0, 1.0, cell.robot.dof), TAPER_AT, TAPER)
    return np.asarray(taper * cell.robot.reach)


def pack_floats(values: Array) -> dict[str, object]:
    """Returns an array for :func:`answer`; NaN stays NaN."""
    data = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"f32": base64.b64encode(data).decode("ascii"), "shape": list(np.shape(values))}


def answer(document: Mapping[str, object]) -> bytes:
    """Returns a document as JSON; numbers that are not finite become null."""
    return json.dumps(json_values(document), allow_nan=False, separators=(",", ":")).encode()
