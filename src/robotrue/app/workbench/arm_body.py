"""The arm as simple bodies to draw: straight tubes along its DH table, a drum on every joint.

Drawn, not computed with: collision and line of sight are the business of ``planning.scene``.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.json_values import json_values
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.planning.arm_scene import THICK, THIN
from robotrue.robot.forward import ChainState, walk, wrist_reach

POINT: Final = 1e-3
"""m; a shorter tube is none."""


def body_document(cell: Cell, joints: Array) -> dict[str, object]:
    """Returns tubes and drums of the arm in n postures.

    ``tubes`` (n, t, 2, 3) m end points in base, ``drums`` (n, dof, 2, 3) m middle and axis,
    ``tool`` (n, 4, 3) m origin and axes of the tool point, radii in m once for all postures;
    ``wrist_reach_m`` as data sheets state it, ``reach_m`` what no posture exceeds, tool included.
    """
    robot = cell.robot.nominal()
    state = walk(robot, joints)
    n, dof = joints.shape
    bends = _bends(robot.convention == "dh", robot.a, robot.d, state)
    knots = np.concatenate([np.zeros((n, 1, 3)), state.link_position], axis=1)
    tubes = [
        pair
        for k in range(dof)
        for pair in ((knots[:, k], bends[:, k]), (bends[:, k], knots[:, k + 1]))
    ]
    tubes += [(knots[:, dof], state.position)]
    ends = np.stack([np.stack(pair, axis=1) for pair in tubes], axis=1)
    radius = _radius(cell)
    wide = np.append(np.repeat(radius, 2), 0.5 * radius[-1])
    kept = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=0) > POINT
    return {
        "tubes": pack_floats(ends[:, kept]),
        "tube_radius_m": wide[kept],
        "drums": pack_floats(np.stack([state.joint_origin, state.joint_axis], axis=2)),
        "drum_radius_m": radius,
        "tool": pack_floats(
            np.concatenate([state.position[:, None], np.swapaxes(state.rotation, 1, 2)], axis=1)
        ),
        "orientation": orientations(state.rotation),
        "reach_m": float(robot.reach),
        "wrist_reach_m": wrist_reach(robot),
        "name": robot.name,
        "dof": dof,
    }


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


def _bends(standard: bool, a: Array, d: Array, state: ChainState) -> Array:
    """Returns where each link turns from along its joint axis to across it, (n, dof, 3) m."""
    across, along = state.link_rotation[..., 0], state.link_rotation[..., 2]
    if standard:
        return np.asarray(state.link_position - across * np.asarray(a)[:, None])
    return np.asarray(state.link_position - along * np.asarray(d)[:, None])


def _radius(cell: Cell) -> Array:
    if cell.link_radius is not None:
        return np.asarray(cell.link_radius)
    dof = cell.robot.dof
    share = np.where(np.arange(dof) < 3, THICK, THIN)
    return np.asarray(share * cell.robot.reach)


def pack_floats(values: Array) -> dict[str, object]:
    """Returns an array for :func:`answer`; NaN stays NaN."""
    data = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"f32": base64.b64encode(data).decode("ascii"), "shape": list(np.shape(values))}


def answer(document: Mapping[str, object]) -> bytes:
    """Returns a document as JSON; numbers that are not finite become null."""
    return json.dumps(json_values(document), allow_nan=False, separators=(",", ":")).encode()
