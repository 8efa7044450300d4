"""Settings of touches with the cell's tool: noise, payload, priors, the tip."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.probing import ProbingSettings
from robotrue.cell.cell import Cell
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.planning.information import settings_of
from robotrue.validation.registration_frame import TOOL, RegistrationSettings
from robotrue.validation.registration_methods import Method
from robotrue.validation.validation_defaults import REGISTRATION_FIT, REGISTRATION_METHOD

UNITS: Final = {"mm": MM, "m": 1.0, "inch": 25.4 * MM}
"""Units of meshes, m."""


def mesh_scale(unit: str) -> float:
    """Returns the m of one unit of a mesh.

    Raises:
        ConfigurationError: No such unit.
    """
    if unit not in UNITS:
        raise ConfigurationError(
            f"--mesh-unit {unit!r}, expected {', '.join(UNITS)}.", hint="--mesh-unit mm"
        )
    return UNITS[unit]


def registration_settings(
    cell: Cell,
    touch_sigma_mm: float,
    *,
    robot_sigma_mm: float | None = None,
    tool_sigma_mm: float | None = None,
    tolerance_mm: float | None = None,
    fit: Literal["auto", "frame", "joint"] = REGISTRATION_FIT,
    method: Method = REGISTRATION_METHOD,
    mesh: TriangleMesh | None = None,
) -> RegistrationSettings:
    """Returns the settings of a registration with the tool of the cell, from sizes in mm."""
    robot, tool, tolerance = (
        None if size is None else size * MM
        for size in (robot_sigma_mm, tool_sigma_mm, tolerance_mm)
    )
    return RegistrationSettings(
        touch=touch_sigma_mm * MM,
        robot=robot,
        tool_sigma=tool,
        tolerance=tolerance,
        fit=fit,
        method=method,
        T_flange_tool=cell.robot.T_flange_tool,
        mesh=mesh,
        arm=settings_of(cell),
    )


def settings_for_touches(
    cell: Cell, arm: ErrorModel, touch_sigma_mm: float, tool_sigma_mm: float | None
) -> ProbingSettings:
    """Returns the settings of an estimate from touches with the tool of the cell.

    Args:
        cell: Its tool touches.
        arm: Calibrated with that tool or another one, or nominal.
        touch_sigma_mm: Per axis, of one touch.
        tool_sigma_mm: Of the tip in the flange; None: 0 where it is the point the model was made
            with, else that of a drawing.
    """
    tip = cell.robot.T_flange_tool
    own = bool(np.allclose(arm.robot.T_flange_tool, tip, atol=1e-9))
    sigma = 0.0 if arm.calibrated and own else TOOL
    return ProbingSettings(
        touch_sigma=touch_sigma_mm * MM,
        tool_sigma=sigma if tool_sigma_mm is None else tool_sigma_mm * MM,
        T_flange_tool=None if own else tip,
        payload=cell.payload,
        priors=settings_of(cell),
    )
