"""The calibrated arm of Universal Robots as the kinematics file of its ROS driver.

The file gives the frame of each joint in that of the joint before, as a URDF ``origin`` does. The
base error is in the first; the tool is outside the format and in a comment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.csv_text import csv_remark
from robotrue.core.provenance import mark_line
from robotrue.errors import ConfigurationError
from robotrue.report.export_description import URDF_CANNOT, rigid
from robotrue.report.export_losses import (
    ExportableModel,
    Loss,
    loss_sentences,
    losses,
    measure_loss,
    require_named,
)
from robotrue.robot.chain import error_pose
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.ur_calibration import FIELDS, kinematics_yaml
from robotrue.robot.urdf_writer import joint_origins, xyz_rpy

CANNOT: Final = URDF_CANNOT
"""What the file has no place for, apart from the tool."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UrExport:
    """The file.

    Attributes:
        text: YAML, with remarks in lines that begin with ``#``.
        robot: The rigid robot of the text, with the tool of the comment.
        total: Error of the file and that tool against the model.
        nominal_tool: Error with the nominal tool and flange instead.
    """

    text: str
    robot: RobotModel
    total: Loss
    nominal_tool: Loss


def export_ur(found: ExportableModel, *, lossy: Sequence[str] = ()) -> UrExport:
    """Returns the kinematics file.

    Args:
        found: From :func:`robotrue.report.export_losses.prepare_export`.
        lossy: Parts the file may leave out.

    Raises:
        ConfigurationError: Another arm than one of Universal Robots in its controller's angles, or
            parts that would be lost and are not named.
    """
    _require_ur(found.tables.robot)
    require_named(found, CANNOT, lossy)
    robot = rigid(found.tables.robot)
    lost = losses(found, [name for name in found.held if name in CANNOT])
    total, nominal_tool = measure_loss(found, robot), measure_loss(found, _nominal_tool(robot))
    origins, links = joint_origins(robot)
    tool = xyz_rpy(links[-1] @ robot.T_flange_tool @ error_pose(robot.error("tool")))
    remarks = [
        f"{robot.name}, calibrated by robotrue, model sha256 {found.digest}",
        "Lengths m, angles rad, base error in shoulder; the hash is of this file, not of the robot",
        "tool in wrist_3, which this format does not contain: "
        + ", ".join(f"{key} {value!r}" for key, value in zip(FIELDS, tool.tolist(), strict=True)),
        *loss_sentences(lost, total),
        f"Read with the nominal tool: misses {nominal_tool.sizes}.",
    ]
    body = kinematics_yaml(np.array([xyz_rpy(origin) for origin in origins]))
    text = mark_line(found.provenance) + "".join(map(csv_remark, remarks)) + body
    return UrExport(text=text, robot=robot, total=total, nominal_tool=nominal_tool)


def _require_ur(robot: RobotModel) -> None:
    counted = robot.controller
    same = np.array_equal(robot.joint_map, np.eye(robot.dof))
    same = same and bool((counted.sign == 1.0).all()) and not counted.offset.any()
    if robot.maker == "ur" and robot.dof == 6 and same:
        return
    raise ConfigurationError(
        f"{robot.name} has {robot.dof} joints, maker {robot.maker!r}"
        f"{'' if same else ', and angles other than those its controller displays'}; the file is "
        "for arms of maker 'ur' with 6 joints and the angles of the controller.",
        hint='export urdf takes any arm; or state maker = "ur" in the cell and calibrate again.',
    )


def _nominal_tool(robot: RobotModel) -> RobotModel:
    """The arm without the errors behind joint 6, which the origins do not contain."""
    errors = np.array(robot.errors)
    errors[parameter_slice(robot.dof, "tool")] = 0.0
    for group in ("a", "alpha", "beta"):
        errors[parameter_slice(robot.dof, group).stop - 1] = 0.0
    return robot.with_errors(errors)
