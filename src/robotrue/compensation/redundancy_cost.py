"""What a spin about the tool axis costs: how far the process force bends the arm."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.robot.forward import walk
from robotrue.robot.model import RobotModel

_BLOCK: Final = 8192


def bending(robot: RobotModel, compliance: Array, joints: Array, wrench: Array) -> Array:
    """Returns how far a wrench moves the tool point (n, 3) m in base, by joint compliance.

    ``dx = J C J^T w`` with the drives' compliance C; the wrench alone, without gravity.

    Args:
        robot: The nominal arm with the tool.
        compliance: (6,) rad/(N m) of the drives.
        joints: (n, 6) rad; NaN gives NaN.
        wrench: (n, 6) N, N m on the tool, at the tool point, in base axes.
    """
    out = np.empty((len(joints), 3))
    for start in range(0, len(joints), _BLOCK):
        part = slice(start, start + _BLOCK)
        state = walk(robot, joints[part])
        axis = state.joint_axis
        move = np.cross(axis, state.position[:, None] - state.joint_origin)
        torque = np.einsum("nij,nj->ni", move, wrench[part, :3])
        torque += np.einsum("nij,nj->ni", axis, wrench[part, 3:])
        drives = (torque @ robot.joint_map) * compliance
        out[part] = np.einsum("ni,nij->nj", drives @ robot.joint_map.T, move)
    return out


def across(vector: Array, direction: Array) -> Array:
    """Returns vectors (n, 3) without their part along unit directions (n, 3); NaN takes nothing."""
    along = np.sum(vector * direction, axis=1, keepdims=True)
    return np.asarray(vector - np.where(np.isnan(along), 0.0, along * np.nan_to_num(direction)))


def stiffness(wrench: Array, moved: Array) -> Array:
    """Returns force over its own deflection (n,) N/m, ``|f|^2 / (f . dx)``; NaN without force."""
    force = wrench[:, :3]
    work = np.sum(force * moved, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(work > 0.0, np.sum(force * force, axis=1) / work, np.nan))
