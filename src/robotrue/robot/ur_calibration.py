"""The factory calibration of an arm of Universal Robots: the YAML of ``ur_calibration`` (ROS).

The file gives the frame of each joint in that of the joint before: x, y, z in m, and roll, pitch,
yaw in rad. Two orders of the angles exist:

* ``ur_calibration`` of both drivers (ROS 1 and ROS 2; three public versions were read) decomposes
  its matrix with Eigen's ``eulerAngles(0, 1, 2)``: R = Rx(roll) Ry(pitch) Rz(yaw). This is the
  geometry of the controller: the matrices from the DH table of the controller agree with it.
* ``ur_description`` puts the numbers into the ``rpy`` of a URDF: R = Rz(yaw) Ry(pitch) Rx(roll).
  The difference is of first order in the yaw of upper_arm, whose roll is 90 deg: 0.02 and 0.9 mm
  (mean over random postures) for two calibrations that the driver's tests contain.

``export ur`` writes the second order, since ``ur_description`` reads it, and states it in the key
``rotation``. A file without this key is of the driver. Versions before 2.4.6 (ROS 2) turn some
links by 180 deg (arctangent of one argument); such a file is refused as that of another arm.

The joint axes 2 to 4 are parallel except for about 0.1 to 0.8 deg, so that their common normals
can be hundreds of metres away. The table of the result has d of the preset for joints 2 and 3 and
a turn beta about y instead (Hayati), and errors in the same parameters stay small.

Source: repositories Universal_Robots_ROS_Driver and Universal_Robots_ROS2_Driver,
ur_calibration/src/calibration.cpp (buildChain, correctAxis, toYaml), its test and changelog;
Universal_Robots_ROS2_Description, urdf/inc/ur_common.xacro; read 2026-11.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import utf8_text
from robotrue.core.poses import inverse as inverse_pose
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.robot.chain import X, Y, Z, turn_about
from robotrue.robot.model import RobotModel
from robotrue.robot.urdf_writer import joint_origins

JOINTS: Final = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
FIELDS: Final = ("x", "y", "z", "roll", "pitch", "yaw")
_URDF_ORDER: Final = "Rz(yaw) Ry(pitch) Rx(roll)"
_LARGEST: Final = {"m": 3.0, "rad": 6.2832}
_MISREAD: Final = {"m": "millimetres", "rad": "degrees"}
_APART: Final = (10.0 * MM, 3.0 * DEG)
"""A frame further than this from the preset's is of another arm."""
_ON_AXIS: Final = 1e-9
"""m and rad by which joint 1 may miss the z axis of the base."""
_LINE: Final = re.compile(r"\s*(\w+)\s*:\s*(.*?)\s*")
_REMARK: Final = re.compile(r"(?:^|\s)#.*")


def kinematics_yaml(values: Array) -> str:
    """Returns the YAML of six origins (6, 6), a row x, y, z in m and roll, pitch, yaw in rad."""
    lines = ["kinematics:"]
    for joint, row in zip(JOINTS, values.tolist(), strict=True):
        lines.append(f"  {joint}:")
        lines += [f"    {key}: {_number(value)}" for key, value in zip(FIELDS, row, strict=True)]
    digest = hashlib.sha256("\n".join(lines).encode("ascii")).hexdigest()
    lines.append(f"  hash: calib_{int(digest[:16], 16)}")
    return "\n".join([*lines, f"rotation: {_URDF_ORDER}", ""])


def _number(value: float) -> str:
    """A float that YAML 1.1 reads as one: its exponent needs a point in the mantissa."""
    text = repr(value)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def read_ur_calibration(robot: RobotModel, data: bytes, source: Path) -> RobotModel:
    """Returns the arm with the geometry of a file; positions of the flange agree to 1e-9 m.

    Args:
        robot: Nominal arm of the type, standard DH.
        data: Content of the file.
        source: Its path.

    Raises:
        FormatError: An unknown, double or missing key, or text in place of a number.
        ConfigurationError: Values in mm or degrees, of another arm, or a base off joint 1.
    """
    if robot.maker != "ur" or robot.convention != "dh" or robot.dof != 6:
        raise ConfigurationError(
            f"robot.ur_calibration for {robot.name} of maker {robot.maker!r}, allowed for arms of "
            "maker 'ur' with six joints and a standard DH table.",
            hint='preset = "UR10"; or convention = "dh", dh and maker = "ur".',
        )
    frames = read_joint_frames(data, source)
    gaps = joint_gaps(robot, frames)
    worst = int((gaps / _APART).max(axis=1).argmax())
    if (gaps > _APART).any():
        far, turned = gaps[worst] / (MM, DEG)
        raise ConfigurationError(
            f"{JOINTS[worst]} is {far:.1f} mm and {turned:.2f} deg from that of {robot.name}, "
            "allowed are 10 mm and 3 deg.",
            source=source,
            hint="the preset of this arm; or read the file from the robot with a newer "
            "ur_calibration (before 2.4.6 it turned some links by 180 deg).",
        )
    off = np.abs([*frames[0][:2, 3], *frames[0][:2, Z]])
    if off.max() > _ON_AXIS:
        raise ConfigurationError(
            f"shoulder is {np.hypot(*off[:2]) / MM:.4f} mm and {np.hypot(*off[2:]) / DEG:.4f} deg "
            "off the z axis of the base, expected 0: joint 1 turns about z of the base.",
            source=source,
            hint="x, y, roll and pitch of shoulder 0; export ur writes the base error there.",
        )
    return _with_frames(robot, frames)


def joint_gaps(robot: RobotModel, frames: Array) -> Array:
    """Returns how far joint frames (6, 4, 4) are from those of an arm, (6, 2) m and rad."""
    apart = inverse_pose(joint_origins(robot.nominal())[0]) @ frames
    cosine = (np.trace(apart[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0
    turned = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.stack([np.linalg.norm(apart[:, :3, 3], axis=1), turned], axis=1)


def read_joint_frames(data: bytes, source: Path) -> Array:
    """Returns the frame of each joint in that of the joint before (6, 4, 4) m, first in base.

    Raises:
        FormatError: As :func:`read_ur_calibration`.
        ConfigurationError: Values in mm or degrees.
    """
    stated, order = _read_keys(utf8_text(data, source), source)
    rows = np.empty((len(JOINTS), len(FIELDS)))
    for i, joint in enumerate(JOINTS):
        for k, key in enumerate(FIELDS):
            if key not in stated.get(joint, {}):
                raise FormatError(
                    f"{joint} has no {key}, expected {', '.join(FIELDS)} of {', '.join(JOINTS)}.",
                    source=source,
                    hint="the file that ur_calibration or export ur writes.",
                )
            rows[i, k] = stated[joint][key]
    turns = [turn_about(axis, rows[:, 3 + axis]) for axis in (X, Y, Z)]
    first, second, third = turns[::-1] if order else turns
    frames = first @ second @ third
    frames[:, :3, 3] = rows[:, :3]
    return frames


def _read_keys(text: str, source: Path) -> tuple[dict[str, dict[str, float]], str]:
    """The numbers by joint and key, and the stated order of the angles."""
    stated: dict[str, dict[str, float]] = {}
    joint, order = "", ""
    for line, written in enumerate(text.splitlines(), 1):
        content = _REMARK.sub("", written).strip()
        key, value = found.groups() if (found := _LINE.fullmatch(content)) else (content, "")
        if key in JOINTS and not value and key not in stated:
            joint = key
            stated[joint] = {}
        elif key in FIELDS and joint and key not in stated[joint]:
            stated[joint][key] = _read_value(f"{joint}.{key}", value, source, line)
        elif key == "rotation" and value.strip("'\"") == _URDF_ORDER:
            order = value
        elif key not in ("", "---", "kinematics", "hash"):
            raise FormatError(
                f"{content!r} is not expected here, allowed are kinematics, {', '.join(JOINTS)}, "
                f"in each once {', '.join(FIELDS)}, hash, and rotation: {_URDF_ORDER}.",
                source=source,
                line=line,
                hint="the file that ur_calibration or export ur writes.",
            )
    return stated, order


def _read_value(name: str, text: str, source: Path, line: int) -> float:
    unit = "m" if name[-2] == "." else "rad"
    try:
        value = float(text)
    except ValueError:
        raise FormatError(
            f"{name} is {text!r}, expected a number in {unit}.",
            source=source,
            line=line,
            hint="the file that ur_calibration or export ur writes.",
        ) from None
    if not abs(value) <= _LARGEST[unit]:
        raise ConfigurationError(
            f"{name} is {value:g} {unit}, allowed -{_LARGEST[unit]:g} to {_LARGEST[unit]:g}.",
            source=source,
            line=line,
            hint=f"check whether the file is in {_MISREAD[unit]}.",
        )
    return value


def _with_frames(robot: RobotModel, frames: Array) -> RobotModel:
    """The arm whose joint axes and flange are those of the frames; d of joints 2 and 3 is kept."""
    theta, d, a, alpha, beta = np.array([robot.theta, robot.d, robot.a, robot.alpha, robot.beta])
    at = frames[0]  # the joint's frame in the link frame before it, always about and along z
    for i in range(5):
        axis = at @ frames[i + 1]  # of the next joint
        z, p = axis[:3, Z], axis[:3, 3]
        if abs(np.sin(alpha[i])) > 0.5:
            sense = np.sign(alpha[i])
            theta[i] = np.arctan2(sense * z[0], -sense * z[1])
            alpha[i] = np.arctan2(sense * np.hypot(z[0], z[1]), z[2])
            along, beside, _ = turn_about(Z, theta[i])[:3, :3].T @ p
            a[i], d[i] = along, p[2] + beside * np.cos(alpha[i]) / np.sin(alpha[i])
        else:
            foot, sense = p + z * (d[i] - p[2]) / z[2], np.copysign(1.0, a[i])
            theta[i] = np.arctan2(sense * foot[1], sense * foot[0])
            a[i] = sense * np.hypot(foot[0], foot[1])
            x, y, up = turn_about(Z, theta[i])[:3, :3].T @ z
            alpha[i], beta[i] = np.arctan2(-y, up), np.arctan2(x, np.hypot(y, up))
        link = turn_about(Z, theta[i]) @ turn_about(X, alpha[i]) @ turn_about(Y, beta[i])
        link[:3, 3] = a[i] * np.cos(theta[i]), a[i] * np.sin(theta[i]), d[i]
        at = inverse_pose(link) @ axis
    theta[5], d[5] = np.arctan2(at[1, 0], at[0, 0]), at[2, 3]
    return replace(robot, theta=theta, d=d, a=a, alpha=alpha, beta=beta)
