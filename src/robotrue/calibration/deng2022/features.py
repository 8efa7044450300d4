"""The feature space of the paper: a pose as six numbers, and what a turn about joint 1 makes of it.

``x = (px, py, pz, rx, ry, rz)`` in m and rad: the tool point and the attitude Rz(rz) Ry(ry) Rx(rx)
in base. The Euler triple nearest to a reference is taken, so that a region has no jump in it.
"""

from __future__ import annotations

import numpy as np

from robotrue.calibration.deng2022.readings import AttitudeReading
from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

PRINTED_UNITS = np.array([MM, MM, MM, DEG, DEG, DEG])
"""(6,) divide by it: the mm and deg the paper computes in."""


def attitude_reference(robot: RobotModel, joints: Array) -> Array:
    """Returns A, B, C (3,) rad of the pose in the middle of a set, by angle about joint 1.

    Args:
        robot: Nominal arm with the measured point as its tool.
        joints: (n, dof) rad, at least one row.
    """
    poses = forward(robot.nominal(), joints)
    angle = np.arctan2(poses[:, 1, 3], poses[:, 0, 3])
    middle = int(np.argsort(angle)[len(angle) // 2])
    return abc_from_matrix(poses[middle, :3, :3])


def pose_features(poses: Array, reference: Array) -> Array:
    """Returns x (n, 6) in m and rad of nominal poses T_base_tool (n, 4, 4).

    Args:
        poses: (n, 4, 4).
        reference: (3,) rad, A, B, C; the Euler triple nearest to it is taken.

    Fails when: the attitude is near ry = +-90 deg; rx and rz then jump between neighbours.
    """
    abc = abc_from_matrix(poses[:, :3, :3], near=reference)
    return np.concatenate([poses[:, :3, 3], abc[:, ::-1]], axis=1)


def turned_features(features: Array, angle: float, attitude: AttitudeReading) -> Array:
    """Returns x (n, 6) of the poses turned by an angle in rad about the base's z axis.

    Args:
        features: (n, 6) m and rad.
        angle: rad.
        attitude: ``turning``: the tool turns with the arm. ``fixed``: its attitude stays.
    """
    out = np.array(features)
    c, s = np.cos(angle), np.sin(angle)
    out[:, 0] = c * features[:, 0] - s * features[:, 1]
    out[:, 1] = s * features[:, 0] + c * features[:, 1]
    if attitude == "turning":
        out[:, 5] += angle
    return out
