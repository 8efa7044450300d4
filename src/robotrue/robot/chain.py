"""The serial arm as constants: what compiled code needs of a robot model to walk its chain.

Between two joint turns every transform is constant, so a chain of n joints is n + 1 constant
transforms ``C`` and n turns about z::

    T_base_tool = C_0 Rz(theta_1) C_1 Rz(theta_2) ... Rz(theta_n) C_n

The constants hold for both DH conventions and include the geometric errors. Transforms are stored
as their first three rows (3, 4). SI.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.robot.model import RobotModel

X: Final = 0
Y: Final = 1
Z: Final = 2
ORIGIN: Final = 3
"""Columns of a transform (3, 4)."""
Record: TypeAlias = Any
"""One row of a structured array; compiled code reads its fields as attributes."""


def chain_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record type of a walked chain.

    Fields: ``theta`` (n,) rad; ``sine`` and ``cosine`` (n,) of it; ``frame`` (n + 1, 3, 4) in base:
    frame i turned by joint i + 1, so that its z is the axis of that joint, then the tool;
    ``moment`` (3,) kg m in base of what was summed last; ``torque`` (n,) N m of the load about the
    axes; ``jacobian`` (6, n) of the tool, dx/dtheta.
    """
    return np.dtype(
        [
            ("theta", np.float64, (dof,)),
            ("sine", np.float64, (dof,)),
            ("cosine", np.float64, (dof,)),
            ("frame", np.float64, (dof + 1, 3, 4)),
            ("moment", np.float64, (3,)),
            ("torque", np.float64, (dof,)),
            ("jacobian", np.float64, (6, dof)),
        ]
    )


def links_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record type of the constants of a chain: ``constant`` (n + 1, 3, 4)."""
    return np.dtype([("constant", np.float64, (dof + 1, 3, 4))])


def masses_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record type of what weighs on an arm.

    Fields: ``moment`` (n, 4) first moment kg m of each link in the frame turned by its joint, and
    its mass kg; ``outboard`` (n,) kg of each link and everything beyond; ``gravity`` (3,) m/s^2.
    """
    return np.dtype(
        [
            ("moment", np.float64, (dof, 4)),
            ("outboard", np.float64, (dof,)),
            ("gravity", np.float64, (3,)),
        ]
    )


def link_constants(robot: RobotModel, T_flange_tool: Array | None = None) -> Array:
    """Returns C_0..C_n (n + 1, 3, 4) of an arm with its errors.

    Args:
        robot: The arm; call with ``robot.nominal()`` for the controller's.
        T_flange_tool: (4, 4) what the flange carries; None: the robot's own, with its error.
    """
    if T_flange_tool is None:
        T_flange_tool = robot.T_flange_tool @ error_pose(robot.error("tool"))
    before, behind = around_joints(robot)
    first, last = error_pose(robot.error("base")) @ before[:1], behind[-1:] @ T_flange_tool
    return np.concatenate([first, behind[:-1] @ before[1:], last])[:, :3]


def links_of(
    robot: RobotModel, T_flange_tool: Array | None = None
) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Returns :func:`link_constants` as one record of :func:`links_dtype`, shape (1,)."""
    links = np.zeros(1, links_dtype(robot.dof))
    links["constant"][0] = link_constants(robot, T_flange_tool)
    return links


def link_frames(robot: RobotModel) -> Array:
    """Returns the link frames (n, 4, 4) in the frames turned by their joints, without errors.

    Centres of mass and inertias of a robot model are given in link frames; the last is the flange.
    """
    return around_joints(robot.nominal())[1]


def link_masses(robot: RobotModel, frames: Array) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Returns the masses of the links as one record of :func:`masses_dtype`, shape (1,).

    Args:
        robot: The arm.
        frames: Its :func:`link_frames`.
    """
    masses = np.zeros(1, masses_dtype(robot.dof))
    centre = np.einsum("nij,nj->ni", frames[:, :3, :3], robot.link_com) + frames[:, :3, 3]
    x = frames[:, :3, 0]
    y = np.cross([0.0, 0.0, 1.0], x)
    along_x, along_y = robot.moments.reshape(2, -1, 1)
    masses["moment"][0, :, :3] = robot.link_mass[:, None] * centre + along_x * x + along_y * y
    masses["moment"][0, :, 3] = robot.link_mass
    masses["outboard"][0] = np.cumsum(robot.link_mass[::-1])[::-1]
    masses["gravity"][0] = robot.gravity
    return masses


def error_pose(values: Array) -> Array:
    """Returns Tx Ty Tz Rx Ry Rz (4, 4) of six errors, m and rad."""
    T = turn_about(X, values[3]) @ turn_about(Y, values[4]) @ turn_about(Z, values[5])
    T[:3, 3] = values[:3]
    return T


def around_joints(robot: RobotModel) -> tuple[Array, Array]:
    """Returns the constant transforms (n, 4, 4) before and after the rotation of each joint."""
    still = np.tile(np.eye(4), (robot.dof, 1, 1))
    along_z, side = still.copy(), still.copy()
    along_z[:, Z, ORIGIN] = robot.d + robot.error("d")
    side[:, X, ORIGIN] = robot.a + robot.error("a")
    twist = turn_about(X, robot.alpha + robot.error("alpha"))
    tilt = turn_about(Y, robot.beta + robot.error("beta"))
    if robot.convention == "dh":
        return still, along_z @ side @ twist @ tilt
    return twist @ side @ tilt, along_z


def turn_about(axis: int, angle: Array | float) -> Array:
    """Returns the pose (..., 4, 4) turned by angles (...) in rad about X, Y or Z."""
    following, last = (axis + 1) % 3, (axis + 2) % 3
    T = np.zeros((*np.shape(angle), 4, 4))
    T[..., axis, axis] = T[..., ORIGIN, ORIGIN] = 1.0
    T[..., following, following] = T[..., last, last] = np.cos(angle)
    T[..., last, following] = np.sin(angle)
    T[..., following, last] = -T[..., last, following]
    return T
