"""What a cell says of touches with its tool: noise, payload, priors, the tip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.calibration.probing_estimate import ProbingSettings
    from robotrue.cell.cell import Cell


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
    import numpy as np

    from robotrue.calibration.probing_estimate import ProbingSettings
    from robotrue.planning.information import settings_of
    from robotrue.validation.registration_frame import TOOL

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
