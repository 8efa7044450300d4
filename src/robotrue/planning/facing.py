"""A posture in front of a part, for parts of which nobody has said how they are machined."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ReachError
from robotrue.measurement.formats.part_points import Features
from robotrue.planning.probing import Machining
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

SPINS: Final = np.arange(0.0, 2.0 * np.pi, np.pi / 6.0)
"""rad about the tool axis that are tried."""
DOWN: Final = np.array([0.0, 0.0, -1.0])
ALIKE: Final = 0.94
"""Cosine between directions of one face."""
MARGIN: Final = 0.05
"""rad kept from the joint limits."""


def facing(
    robot: RobotModel, features: Features, T_base_part: Mapping[int, Array], tip_axis: Array
) -> Machining:
    """Returns one posture with the tool against the part, for candidates to take attitudes from.

    The tool looks straight at the face that most features are on, from above where nothing is said
    of faces; of its turns about that axis the one nearest to the middle of the joint limits.

    Args:
        robot: Nominal arm with the touching tip as its tool.
        features: Of the part.
        T_base_part: (4, 4) of every part, roughly.
        tip_axis: (3,) unit, the way from the flange to the tip, in the tool frame.

    Raises:
        ReachError: The middle of the features cannot be reached.
    """
    place = np.stack([T_base_part[int(k)] for k in features.part])
    point = apply(place, features.point)
    known = np.where(np.isnan(features.access), features.normal, features.access)
    outward = (place[:, :3, :3] @ np.nan_to_num(known)[:, :, None])[:, :, 0]
    alike = (outward @ outward.T > ALIKE).sum(axis=1)
    first = int(np.argmax(alike))
    mine = outward @ outward[first] > ALIKE if alike[first] else np.ones(len(point), dtype=bool)
    middle = point[mine].mean(axis=0)
    nearest = int(np.argmin(np.where(mine, np.linalg.norm(point - middle, axis=1), np.inf)))
    for direction in (*([-outward[first]] if alike[first] else []), DOWN):
        joints = _reach_direction(robot, point[nearest], direction, tip_axis)
        if joints is not None:
            return Machining(
                group=("part",), point=features.point[[nearest]], joints=joints[None],
                part=features.part[[nearest]],
            )  # fmt: skip
    x, y, z = point[nearest] * 1e3
    raise ReachError(
        f"the arm cannot touch {features.names[nearest]!r} at {x:.0f}, {y:.0f}, {z:.0f} mm in "
        "base, in any turn of the tool.",
        hint="check the rough frame of the part and the tool of the cell.",
    )


def _reach_direction(
    robot: RobotModel, point: Array, direction: Array, tip_axis: Array
) -> Array | None:
    """Joints (dof,) with the tool axis along a direction, in the middle of their limits."""
    low, high = robot.limits[:, 0] + MARGIN, robot.limits[:, 1] - MARGIN
    middle = np.where(np.isfinite(low + high), 0.5 * (low + high), 0.0)
    turns = matrix_from_rotation_vector(SPINS[:, None] * direction)
    wanted = pose(
        turns @ _rotate_onto(tip_axis, direction), np.broadcast_to(point, (len(turns), 3))
    )
    if opw_geometry(robot) is not None:
        joints = inverse_batch(robot, wanted, near=middle)
    else:
        found = solve(robot.nominal(), wanted, np.tile(middle, (len(wanted), 1)))
        joints = np.where(found.converged[:, None], found.joints, np.nan)
    with np.errstate(invalid="ignore"):
        able = ((joints >= low) & (joints <= high)).all(axis=1)
    if not able.any():
        return None
    away = np.where(able, np.linalg.norm(np.nan_to_num(joints) - middle, axis=1), np.inf)
    return np.asarray(joints[int(np.argmin(away))])


def _rotate_onto(axis: Array, to: Array) -> Array:
    """The smallest rotation (3, 3) that takes one unit vector to another."""
    about = np.cross(axis, to)
    sine, cosine = float(np.linalg.norm(about)), float(axis @ to)
    if sine < 1e-9:
        about = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        sine = float(np.linalg.norm(about))
        return matrix_from_rotation_vector(about / sine * (0.0 if cosine > 0.0 else np.pi))
    return matrix_from_rotation_vector(about / sine * float(np.arctan2(sine, cosine)))
