"""A cell beside a model: what the cell states holds, what it leaves out is as when calibrated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.robot.model import RobotModel, nominal_identity

_SAME = 1e-6  # rad by which joint limits may differ: they are printed


def overlay_cell(cell: Cell, place: Cell) -> Cell:
    """Returns the cell of a model with what another cell states: frames, tool, payload, controller.

    Args:
        cell: Of the day of calibration.
        place: As it is now. Its ``[base]``, ``[tool]``, ``[payload]``, ``[controller]`` and part
            frames hold where it has them.

    Raises:
        ConfigurationError: It has none of them, or other joint limits than the model.
        ModelMismatchError: Its arm is another one, or counts its axes in another way.
    """
    _require_same_arm(cell.robot, place)
    overlaid = cell
    if place.part is not None:
        overlaid = replace(overlaid, part=place.part, T_base_frame=place.T_base_frame)
    elif "base" in place.tables:
        overlaid = replace(overlaid, T_base_frame=place.T_base_frame)
    if "tool" in place.tables:
        overlaid = replace(overlaid, robot=cell.robot.with_tool(place.robot.T_flange_tool))
    if "payload" in place.tables:
        overlaid = replace(overlaid, payload=place.payload)
    if place.says_of_controller:
        overlaid = replace(overlaid, controller=place.controller)
    if overlaid is cell:
        raise ConfigurationError(
            "the cell states nothing that is used beside a model: no [base], [tool], [payload] or "
            "[controller], and no part frame.",
            source=place.source or None,
            hint="write what holds now into it, or leave --cell out.",
        )
    return overlaid


def _require_same_arm(robot: RobotModel, place: Cell) -> None:
    other, source = place.robot, place.source or None
    if not nominal_identity(other).same(nominal_identity(robot)):
        raise ModelMismatchError(
            f"the cell describes {other.name}, whose geometry is not that of the model's "
            f"{robot.name}.",
            source=source,
            hint="the [robot] table of the cell the model was calibrated with.",
        )
    if other.maker != robot.maker or not _counts_alike(robot, other):
        raise ModelMismatchError(
            f"[robot] of the cell is of maker {other.maker!r}, that of the model of maker "
            f"{robot.maker!r}, or they count their axes in different ways; the model's would hold.",
            source=source,
            hint="calibrate again with this cell, or take maker and axes_... out of it.",
        )
    if np.abs(other.limits - robot.limits).max() > _SAME:
        raise ConfigurationError(
            "[robot] limits_deg of the cell are not those of the model, which would hold.",
            source=source,
            hint="calibrate again with this cell, or write the model's limits.",
        )


def _counts_alike(one: RobotModel, other: RobotModel) -> bool:
    if one.controller is None or other.controller is None:
        return one.controller is other.controller
    names = ("sign", "offset", "coupling")
    pairs = [(getattr(one.controller, n), getattr(other.controller, n)) for n in names]
    return all(a.shape == b.shape and np.allclose(a, b, atol=_SAME) for a, b in pairs)
