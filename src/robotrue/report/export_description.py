"""The calibrated robot as URDF, with effects beyond URDF in a second file, and as a DH table.

The DH table (CSV) has one row a joint, then base and tool.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_remark, csv_text
from robotrue.core.provenance import mark_line, mark_title
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.report.export_losses import (
    ExportableModel,
    Loss,
    loss_document,
    loss_sentences,
    losses,
    measure_loss,
    part_left_over,
    require_named,
)
from robotrue.robot.chain import error_pose
from robotrue.robot.model import MOMENTS, RobotModel, parameter_slice
from robotrue.robot.urdf import to_urdf

URDF_CANNOT: Final = ("gear", "compliance", "ripple", "backlash", "residual")
"""What URDF has no words for."""
DH_CANNOT: Final = ("ripple", "backlash", "residual")
"""What has no column."""
DH_COLUMNS: Final = (
    "row", "theta_deg", "d_mm", "a_mm", "alpha_deg", "beta_deg", "gear", "compliance_rad_per_Nm",
    "moment_x_kg_m", "moment_y_kg_m", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfExport:
    """Two files.

    Attributes:
        urdf: Text of the rigid calibrated robot; ``tool0`` is the measured point.
        side: JSON of the effects beyond URDF.
        robot: The rigid robot of the text.
        total: Error of the URDF alone against the model.
    """

    urdf: str
    side: str
    robot: RobotModel
    total: Loss


def export_urdf(found: ExportableModel, *, lossy: Sequence[str] = ()) -> UrdfExport:
    """Returns the URDF and its side-file.

    The side-file holds all omitted parts, so that both files contain the whole mean.

    Args:
        found: From :func:`robotrue.report.export_losses.prepare_export`.
        lossy: Parts the URDF may leave out.

    Raises:
        ConfigurationError: Parts that would be lost and are not named, or coupled joints.
    """
    require_named(found, URDF_CANNOT, lossy)
    robot = rigid(found.tables.robot)
    lost = losses(found, [name for name in found.held if name in URDF_CANNOT])
    total = measure_loss(found, robot)
    head, _, rest = to_urdf(robot).partition("\n")
    said = [
        mark_title("Calibrated by robotrue", found.provenance)
        + ": lengths m, angles rad, joints in the sense of the robot model.",
        f"Model sha256 {found.digest}.",
        *loss_sentences(lost, total),
    ]
    comment = "<!--\n" + "\n".join(f"  {line}" for line in said) + "\n-->"
    side = {
        **_urdf_side(found),
        "simulated": found.provenance.simulated,
        **loss_document(lost, total),
    }
    return UrdfExport(
        urdf=f"{head}\n{comment}\n{rest}",
        side=json.dumps(side, indent=1, allow_nan=False) + "\n",
        robot=robot,
        total=total,
    )


def rigid(robot: RobotModel) -> RobotModel:
    """Returns the arm with its geometric errors alone: no gear errors, no compliance.

    Raises:
        ConfigurationError: A name XML comments cannot hold.
    """
    if "--" in robot.name:
        raise ConfigurationError(
            f"robot name {robot.name!r} holds '--', which no XML comment may.",
            hint="rename the robot in the cell.",
        )
    errors = np.array(robot.errors)
    for group in ("gear", "compliance", *MOMENTS):
        errors[parameter_slice(robot.dof, group)] = 0.0
    return robot.with_errors(errors)


def _urdf_side(found: ExportableModel) -> dict[str, object]:
    t, robot = found.tables, found.tables.robot
    return {
        "format": "robotrue-urdf-side-file",
        "format_version": 1,
        "robot": robot.name,
        "model_sha256": found.digest,
        "formula": "q_drive = (1 + gear) q + ripple(q) + backlash * sign + compliance * torque; "
        "the URDF takes q_drive; then p = p_urdf + residual(q). "
        "ripple_i = sum_k sin[i][k] sin(harmonics[k] q_i) + cos[i][k] cos(harmonics[k] q_i). "
        "residual = sum_m weights[m] exp(-|scale * (sin q, cos q) - centres[m]|^2 / 2). "
        "torque: load on the drives by gravity, payload and wrench, at the nominal posture. "
        "link_moment_x and _y: first moments beyond the link masses, along x of the link frame "
        "and along the joint axis times x.",
        "compliance_rad_per_Nm": _list(robot.error("compliance")),
        "gear_relative": _list(robot.error("gear")),
        "ripple": {
            "harmonics_per_turn": _list(t.harmonics),
            "sin_rad": _list(t.ripple_sin),
            "cos_rad": _list(t.ripple_cos),
        },
        "backlash_rad": _list(t.backlash),
        "residual": {
            "centres": _list(t.centres),
            "scale": _list(t.scale),
            "weights_m": _list(t.weights),
        },
        "gravity_m_per_s2": _list(robot.gravity),
        "link_mass_kg": _list(robot.link_mass),
        "link_centre_of_mass_m": _list(robot.link_com),
        "link_moment_x_kg_m": _list(robot.error("moment_x")),
        "link_moment_y_kg_m": _list(robot.error("moment_y")),
        "payload_mass_kg": float(found.load.mass[0]),
        "payload_centre_of_mass_m": _list(found.load.com[0]),
    }


def _list(values: Array) -> object:
    return np.asarray(values).tolist()


@dataclass(frozen=True, slots=True, kw_only=True)
class DhExport:
    """The table.

    Attributes:
        text: CSV with remarks in lines that begin with ``#``.
        total: What the rows miss of the model, all columns used.
        as_rigid: What they miss where gear and compliance are not read, as most programs do.
    """

    text: str
    total: Loss
    as_rigid: Loss


def export_dh(found: ExportableModel, *, lossy: Sequence[str] = ()) -> DhExport:
    """Returns the table.

    Args:
        found: From :func:`robotrue.report.export_losses.prepare_export`.
        lossy: Parts the table may leave out.

    Raises:
        ConfigurationError: Parts that would be lost and are not named, or coupled joints.
    """
    require_named(found, DH_CANNOT, lossy)
    robot = found.tables.robot
    if not np.array_equal(robot.joint_map, np.eye(robot.dof)):
        raise ConfigurationError(
            f"{robot.name} couples its joints (parallelogram), which a DH table cannot hold.",
            hint="export the serial arm: replace(robot, joint_map=np.eye(6)).",
        )
    lost = losses(found, [name for name in found.held if name in DH_CANNOT])
    total = part_left_over(found, DH_CANNOT)
    as_rigid = measure_loss(found, rigid(robot))
    head = mark_line(found.provenance)
    head += "".join(map(csv_remark, _dh_remarks(robot, found, lost, total, as_rigid)))
    text = head + csv_text([DH_COLUMNS, *_dh_rows(robot)])
    return DhExport(text=text, total=total, as_rigid=as_rigid)


def _dh_remarks(
    robot: RobotModel, found: ExportableModel, lost: Sequence[Loss], total: Loss, as_rigid: Loss
) -> list[str]:
    link = {
        "dh": "standard DH: Rz(theta + q) Tz(d) Tx(a) Rx(alpha) Ry(beta)",
        "mdh": "modified DH: Rx(alpha) Tx(a) Ry(beta) Rz(theta + q) Tz(d)",
    }[robot.convention]
    return [
        f"{robot.name}, calibrated by robotrue, model sha256 {found.digest}",
        f"{link}; base before the first, tool after the last: T(x,y,z) Rz(a) Ry(b) Rx(c)",
        "q_drive = (1 + gear) q + compliance * torque on the drive; moment_x, moment_y: "
        "first moments beyond link masses, along x of the link frame and the joint axis times x",
        *loss_sentences(lost, total),
        f"Read without gear and compliance: misses {as_rigid.sizes}.",
    ]


def _dh_rows(robot: RobotModel) -> list[list[str]]:
    groups = {
        "theta": (robot.theta + robot.error("theta")) / DEG,
        "d": (robot.d + robot.error("d")) / MM,
        "a": (robot.a + robot.error("a")) / MM,
        "alpha": (robot.alpha + robot.error("alpha")) / DEG,
        "beta": (robot.beta + robot.error("beta")) / DEG,
        "gear": robot.error("gear"),
        **{name: robot.error(name) for name in ("compliance", *MOMENTS)},
    }
    rows = [
        [f"joint {i + 1}", *(repr(float(values[i])) for values in groups.values()), *[""] * 6]
        for i in range(robot.dof)
    ]
    tool = robot.T_flange_tool @ error_pose(robot.error("tool"))
    for name, T in (("base", error_pose(robot.error("base"))), ("tool", tool)):
        place = [*(T[:3, 3] / MM), *(abc_from_matrix(T[:3, :3]) / DEG)]
        rows.append([name, *[""] * (len(groups)), *(repr(float(v)) for v in place)])
    return rows
