"""A robot model's geometry, nominal or calibrated, as URDF text.

Joint i turns about the z axis of its frame; everything constant between two joints is one
``origin``. Links are named ``base_link``, ``link_1`` ... ``link_n``, ``flange``, ``tool0``.
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply
from robotrue.errors import ConfigurationError
from robotrue.robot.chain import Z, around_joints, error_pose, turn_about
from robotrue.robot.model import RobotModel


def to_urdf(robot: RobotModel, *, geometry_only: bool = False) -> str:
    """Returns the arm as URDF text, with its geometric errors.

    ``tool0`` is the tool point including the tool error; call on ``robot.nominal()`` for the
    controller's model. Masses are written as points, without inertia.

    Args:
        robot: The arm.
        geometry_only: Leave gear errors and compliance out instead of refusing.

    Raises:
        ConfigurationError: A parallelogram, which URDF cannot hold; or gear errors or compliance,
            and not ``geometry_only``.
    """
    _refuse_loss(robot, geometry_only)
    origins, links = joint_origins(robot)
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(robot.name)}>"]
    lines.append('  <link name="base_link"/>')
    parent = "base_link"
    for i in range(robot.dof):
        name = f"link_{i + 1}"
        lines += _joint(robot, i, parent, origins[i])
        lines += _link(name, float(robot.link_mass[i]), apply(links[i], robot.link_com[i]))
        parent = name
    lines += _fixed_joint("flange", parent, links[-1])
    lines += _fixed_joint("tool0", "flange", robot.T_flange_tool @ error_pose(robot.error("tool")))
    return "\n".join([*lines, "</robot>", ""])


def joint_origins(robot: RobotModel) -> tuple[Array, Array]:
    """Returns the constant transforms of a chain whose joints turn about z, with all errors.

    Returns:
        (n, 4, 4) m, frame of each joint in that of the joint before, of the first in base; and
        (n, 4, 4) m, frame of each link in that of its joint, of the last the flange.
    """
    before, after = around_joints(robot)
    turn = turn_about(Z, robot.theta + robot.error("theta"))
    # Tz(d) commutes with the joint; before it, the frames are those of the makers' own URDF files.
    ahead = np.tile(np.eye(4), (robot.dof, 1, 1))
    ahead[:, Z, 3] = robot.d + robot.error("d")
    back = ahead.copy()
    back[:, Z, 3] *= -1.0
    links = back @ after
    gaps = np.concatenate([error_pose(robot.error("base"))[None], links[:-1]])
    return gaps @ before @ turn @ ahead, links


def _refuse_loss(robot: RobotModel, geometry_only: bool) -> None:
    if not np.array_equal(np.abs(robot.joint_map), np.eye(robot.dof)):
        raise ConfigurationError(
            f"{robot.name} couples its joints (parallelogram); URDF has no joint of two others.",
            hint="export the serial arm: replace(robot, joint_map=np.eye(6)), and convert the "
            "joints where they are used.",
        )
    lost = [name for name in ("gear", "compliance") if robot.error(name).any()]
    lost += ["moment"] if robot.moments.any() else []
    if lost and not geometry_only:
        raise ConfigurationError(
            f"{robot.name} has {' and '.join(lost)} errors, which URDF cannot represent.",
            hint="geometry_only=True leaves them out.",
        )


def _joint(robot: RobotModel, i: int, parent: str, origin: Array) -> list[str]:
    low, high = (float(v) for v in robot.limits[i])
    sense = int(robot.joint_map[i, i])
    return [
        f'  <joint name="joint_{i + 1}" type="revolute">',
        f'    <parent link="{parent}"/>',
        f'    <child link="link_{i + 1}"/>',
        f"    {_origin(origin)}",
        f'    <axis xyz="0 0 {sense}"/>',
        f'    <limit lower="{low!r}" upper="{high!r}" effort="0" velocity="0"/>',
        "  </joint>",
    ]


def _link(name: str, mass: float, com: Array) -> list[str]:
    if mass == 0.0:
        return [f'  <link name="{name}"/>']
    return [
        f'  <link name="{name}">',
        "    <inertial>",
        f'      <origin xyz="{_words(com)}" rpy="0 0 0"/>',
        f'      <mass value="{mass!r}"/>',
        '      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>',
        "    </inertial>",
        "  </link>",
    ]


def _fixed_joint(name: str, parent: str, origin: Array) -> list[str]:
    return [
        f'  <joint name="{parent}-{name}" type="fixed">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{name}"/>',
        f"    {_origin(origin)}",
        "  </joint>",
        f'  <link name="{name}"/>',
    ]


def _origin(transform: Array) -> str:
    values = xyz_rpy(transform)
    return f'<origin xyz="{_words(values[:3])}" rpy="{_words(values[3:])}"/>'


def xyz_rpy(transform: Array) -> Array:
    """Returns x, y, z in m and roll, pitch, yaw in rad (6,): T(xyz) Rz(yaw) Ry(pitch) Rx(roll)."""
    r = transform[:3, :3]
    yaw = np.arctan2(r[1, 0], r[0, 0])
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    # Roll from what yaw leaves: exact also near a pitch of 90 deg, where yaw itself is arbitrary.
    side = np.cos(yaw) * r[1] - np.sin(yaw) * r[0]
    roll = np.arctan2(-side[2], side[1])
    return np.array([*transform[:3, 3], roll, pitch, yaw])


def _words(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
