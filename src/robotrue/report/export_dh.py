"""The calibrated robot as a DH table (CSV): one row a joint, then base and tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.csv_text import csv_remark, csv_text
from robotrue.core.provenance import mark_line
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.report.export_losses import (
    ExportableModel,
    Loss,
    loss_sentences,
    losses,
    measure_loss,
    part_left_over,
    require_named,
)
from robotrue.report.export_urdf import rigid
from robotrue.robot.chain import error_pose
from robotrue.robot.model import RobotModel

CANNOT: Final = ("ripple", "backlash", "residual")
"""What has no column."""
COLUMNS: Final = (
    "row", "theta_deg", "d_mm", "a_mm", "alpha_deg", "beta_deg", "gear", "compliance_rad_per_Nm",
    "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg",
)  # fmt: skip


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
    require_named(found, CANNOT, lossy)
    robot = found.tables.robot
    if not np.array_equal(robot.joint_map, np.eye(robot.dof)):
        raise ConfigurationError(
            f"{robot.name} couples its joints (parallelogram), which a DH table does not say.",
            hint="export the serial arm: replace(robot, joint_map=np.eye(6)).",
        )
    lost = losses(found, [name for name in found.held if name in CANNOT])
    total = part_left_over(found, CANNOT)
    as_rigid = measure_loss(found, rigid(robot))
    head = mark_line(found.provenance)
    head += "".join(map(csv_remark, _remarks(robot, found, lost, total, as_rigid)))
    text = head + csv_text([COLUMNS, *_rows(robot)])
    return DhExport(text=text, total=total, as_rigid=as_rigid)


def _remarks(
    robot: RobotModel, found: ExportableModel, lost: Sequence[Loss], total: Loss, as_rigid: Loss
) -> list[str]:
    link = {
        "dh": "standard DH: Rz(theta + q) Tz(d) Tx(a) Rx(alpha) Ry(beta)",
        "mdh": "modified DH: Rx(alpha) Tx(a) Ry(beta) Rz(theta + q) Tz(d)",
    }[robot.convention]
    return [
        f"{robot.name}, calibrated by robotrue, model sha256 {found.digest}",
        f"{link}; base before the first, tool after the last: T(x,y,z) Rz(a) Ry(b) Rx(c)",
        "q_drive = (1 + gear) q + compliance * torque on the drive",
        *loss_sentences(lost, total),
        f"Read without gear and compliance: misses {as_rigid.rms / MM:.4f} mm rms, "
        f"{as_rigid.largest / MM:.4f} mm at most.",
    ]


def _rows(robot: RobotModel) -> list[list[str]]:
    groups = {
        "theta": (robot.theta + robot.error("theta")) / DEG,
        "d": (robot.d + robot.error("d")) / MM,
        "a": (robot.a + robot.error("a")) / MM,
        "alpha": (robot.alpha + robot.error("alpha")) / DEG,
        "beta": robot.error("beta") / DEG,
        "gear": robot.error("gear"),
        "compliance": robot.error("compliance"),
    }
    rows = [
        [f"joint {i + 1}", *(repr(float(values[i])) for values in groups.values()), *[""] * 6]
        for i in range(robot.dof)
    ]
    tool = robot.T_flange_tool @ error_pose(robot.error("tool"))
    for name, T in (("base", error_pose(robot.error("base"))), ("tool", tool)):
        place = [*(T[:3, 3] / MM), *(abc_from_matrix(T[:3, :3]) / DEG)]
        rows.append([name, *[""] * 7, *(repr(float(v)) for v in place)])
    return rows
