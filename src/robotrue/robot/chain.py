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
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc
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
    ``torque`` (n,) N m of the load about the axes; ``jacobian`` (6, n) of the tool, dx/dtheta.
    """
    return np.dtype(
        [
            ("theta", np.float64, (dof,)),
            ("sine", np.float64, (dof,)),
            ("cosine", np.float64, (dof,)),
            ("frame", np.float64, (dof + 1, 3, 4)),
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
    constants = [error_pose(robot.error("base")) @ before[0]]
    constants += [behind[i] @ before[i + 1] for i in range(robot.dof - 1)]
    constants.append(behind[-1] @ T_flange_tool)
    return np.array([constant[:3] for constant in constants])


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
    return np.array(around_joints(robot.nominal())[1])


def link_masses(robot: RobotModel) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Returns the masses of the links as one record of :func:`masses_dtype`, shape (1,)."""
    masses = np.zeros(1, masses_dtype(robot.dof))
    frames = link_frames(robot)
    centre = np.einsum("nij,nj->ni", frames[:, :3, :3], robot.link_com) + frames[:, :3, 3]
    masses["moment"][0, :, :3] = robot.link_mass[:, None] * centre
    masses["moment"][0, :, 3] = robot.link_mass
    masses["outboard"][0] = np.cumsum(robot.link_mass[::-1])[::-1]
    masses["gravity"][0] = robot.gravity
    return masses


def error_pose(values: Array) -> Array:
    """Returns Tx Ty Tz Rx Ry Rz (4, 4) of six errors, m and rad."""
    turned = turn_about("x", values[3]) @ turn_about("y", values[4]) @ turn_about("z", values[5])
    return pose(turned[:3, :3], values[:3])


def around_joints(robot: RobotModel) -> tuple[list[Array], list[Array]]:
    """Returns the constant transforms before and behind the turn of each joint, (4, 4) each."""
    d = robot.d + robot.error("d")
    a = robot.a + robot.error("a")
    alpha = robot.alpha + robot.error("alpha")
    beta = robot.error("beta")
    before, behind = [], []
    for i in range(robot.dof):
        along_z = pose(np.eye(3), np.array([0.0, 0.0, d[i]]))
        side = pose(np.eye(3), np.array([a[i], 0.0, 0.0]))
        if robot.convention == "dh":
            before.append(np.eye(4))
            behind.append(along_z @ side @ turn_about("x", alpha[i]) @ turn_about("y", beta[i]))
        else:
            before.append(turn_about("x", alpha[i]) @ side @ turn_about("y", beta[i]))
            behind.append(along_z)
    return before, behind


def turn_about(axis: str, angle: float) -> Array:
    """Returns the pose (4, 4) turned by an angle in rad about x, y or z."""
    abc = np.zeros(3)
    abc["zyx".index(axis)] = angle
    return pose(matrix_from_abc(abc), np.zeros(3))
