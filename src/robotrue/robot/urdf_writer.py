"""A robot model's geometry, nominal or calibrated, as URDF text.

Joint i turns about the z of its own frame; everything constant between two joints is one
``origin``. Links are named ``base_link``, ``link_1`` ... ``link_n``, ``flange``, ``tool0``.
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply
from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel


def to_urdf(robot: RobotModel, *, geometry_only: bool = False) -> str:
    """Returns the arm as URDF text, with its geometric errors.

    ``tool0`` is the tool point including the tool error; call on ``robot.nominal()`` for what the
    controller believes. Masses are written as points, without inertia.

    Args:
        robot: The arm.
        geometry_only: Leave gear errors and compliance out instead of refusing.

    Raises:
        ConfigurationError: A parallelogram, which URDF cannot say; or gear errors or compliance,
            and not ``geometry_only``.
    """
    _refuse_loss(robot, geometry_only)
    before, after = _constants(robot)
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(robot.name)}>"]
    lines.append('  <link name="base_link"/>')
    parent, gap = "base_link", error_pose(robot.error("base"))
    for i in range(robot.dof):
        name = f"link_{i + 1}"
        lines += _joint(robot, i, parent, gap @ before[i])
        lines += _link(name, float(robot.link_mass[i]), apply(after[i], robot.link_com[i]))
        parent, gap = name, after[i]
    lines += _fixed_joint("flange", parent, gap)
    lines += _fixed_joint("tool0", "flange", robot.T_flange_tool @ error_pose(robot.error("tool")))
    return "\n".join([*lines, "</robot>", ""])


def _refuse_loss(robot: RobotModel, geometry_only: bool) -> None:
    if not np.array_equal(np.abs(robot.joint_map), np.eye(robot.dof)):
        raise ConfigurationError(
            f"{robot.name} couples its joints (parallelogram); URDF has no joint of two others.",
            hint="export the serial arm: replace(robot, joint_map=np.eye(6)), and convert the "
            "joints where they are used.",
        )
    lost = [name for name in ("gear", "compliance") if robot.error(name).any()]
    if lost and not geometry_only:
        raise ConfigurationError(
            f"{robot.name} has {' and '.join(lost)} errors, which URDF cannot say.",
            hint="geometry_only=True leaves them out.",
        )


def _constants(robot: RobotModel) -> tuple[list[Array], list[Array]]:
    """What stands before and after the rotation of each joint."""
    before, after = [], []
    beta = robot.error("beta")
    for i in range(robot.dof):
        turn = _turn(2, float(robot.theta[i] + robot.error("theta")[i]))
        rise = _move(2, float(robot.d[i] + robot.error("d")[i]))
        out = _move(0, float(robot.a[i] + robot.error("a")[i]))
        twist = _turn(0, float(robot.alpha[i] + robot.error("alpha")[i]))
        tilt = _turn(1, float(beta[i]))
        if robot.convention == "dh":
            before.append(turn)
            after.append(rise @ out @ twist @ tilt)
        else:
            before.append(twist @ out @ tilt @ turn @ rise)  # Tz(d) commutes with the joint
            after.append(np.eye(4))
    return before, after


def _turn(axis: int, angle: float) -> Array:
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(4)
    out[j, j] = out[k, k] = np.cos(angle)
    out[k, j], out[j, k] = np.sin(angle), -np.sin(angle)
    return out


def _move(axis: int, length: float) -> Array:
    out = np.eye(4)
    out[axis, 3] = length
    return out


def error_pose(values: Array) -> Array:
    """Returns the (4, 4) pose of an error Tx Ty Tz Rx Ry Rz (m, rad), in that order."""
    out = np.eye(4)
    for k in range(3):
        out = out @ _move(k, float(values[k]))
    for k in range(3):
        out = out @ _turn(k, float(values[3 + k]))
    return out


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
    r = transform[:3, :3]
    yaw = np.arctan2(r[1, 0], r[0, 0])
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    # Roll from what yaw leaves: exact also near a pitch of 90 deg, where yaw itself is arbitrary.
    side = np.cos(yaw) * r[1] - np.sin(yaw) * r[0]
    roll = np.arctan2(-side[2], side[1])
    rpy = np.array([roll, pitch, yaw])
    return f'<origin xyz="{_words(transform[:3, 3])}" rpy="{_words(rpy)}"/>'


def _words(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
