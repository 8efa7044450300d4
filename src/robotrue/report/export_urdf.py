"""The calibrated robot as URDF, with everything URDF cannot say in a file beside it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import mark_title
from robotrue.errors import ConfigurationError
from robotrue.report.export_losses import (
    ExportableModel,
    Loss,
    loss_document,
    loss_sentences,
    losses,
    measure_loss,
    require_named,
)
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.urdf import to_urdf

CANNOT: Final = ("gear", "compliance", "ripple", "backlash", "residual")
"""What URDF has no words for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfExport:
    """Two files.

    Attributes:
        urdf: Text of the rigid calibrated robot; ``tool0`` is the measured point.
        side: JSON of what URDF cannot say.
        robot: The rigid robot the text says.
        total: What the URDF alone misses of the model.
    """

    urdf: str
    side: str
    robot: RobotModel
    total: Loss


def export_urdf(found: ExportableModel, *, lossy: Sequence[str] = ()) -> UrdfExport:
    """Returns the URDF and its side-file.

    The side-file holds all that was left out, so that who reads both has the whole mean.

    Args:
        found: From :func:`robotrue.report.export_losses.prepare_export`.
        lossy: Parts the URDF may leave out.

    Raises:
        ConfigurationError: Parts that would be lost and are not named, or coupled joints.
    """
    require_named(found, CANNOT, lossy)
    robot = rigid(found.tables.robot)
    lost = losses(found, [name for name in found.held if name in CANNOT])
    total = measure_loss(found, robot)
    head, _, rest = to_urdf(robot).partition("\n")
    said = [
        mark_title("Calibrated by robotrue", found.provenance)
        + ": lengths m, angles rad, joints in the sense of the robot model.",
        f"Model sha256 {found.digest}.",
        *loss_sentences(lost, total),
    ]
    comment = "<!--\n" + "\n".join(f"  {line}" for line in said) + "\n-->"
    side = {**_side(found), "simulated": found.provenance.simulated, **loss_document(lost, total)}
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
    for group in ("gear", "compliance"):
        errors[parameter_slice(robot.dof, group)] = 0.0
    return robot.with_errors(errors)


def _side(found: ExportableModel) -> dict[str, Any]:
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
        "torque: load on the drives by gravity, payload and wrench, at the nominal posture.",
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
        "payload_mass_kg": float(found.load.mass[0]),
        "payload_centre_of_mass_m": _list(found.load.com[0]),
    }


def _list(values: Array) -> Any:
    return np.asarray(values).tolist()
