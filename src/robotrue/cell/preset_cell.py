"""A cell from the robot's type and a few numbers, for those who have no cell.toml yet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.writer import HEADING, cell_text
from robotrue.core.arrays import Array
from robotrue.core.units import MM, UM
from robotrue.measurement.measurement_set import MeasurementFrame
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, one_sigma
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

FIRST_LINE: Final = "# Made from a preset; change and extend it.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class PresetCell:
    """What is known of a cell, SI.

    Attributes:
        robot: Name of a preset.
        T_flange_tool: (4, 4) m.
        mass: kg on the flange.
        centre: (3,) m of that mass, in the flange frame.
        repeatability: m, ISO 9283 RP.
        frame: Of measured positions.
        sigma: m per axis of the instrument; None with ``sigma_per_m`` None: a usual tracker.
        sigma_per_m: m per m of range.
    """

    robot: str
    T_flange_tool: Array
    mass: float
    centre: Array
    repeatability: float
    frame: MeasurementFrame = "base"
    sigma: float | None = None
    sigma_per_m: float | None = None


def preset_cell(stated: PresetCell) -> Cell:
    """Returns the cell.

    Raises:
        ConfigurationError: No such preset.
        ShapeError: A number that cannot be.
    """
    tracker = DEFAULT_SPECIFICATION
    if stated.sigma is not None or stated.sigma_per_m is not None:
        tracker = one_sigma(stated.sigma or 0.0, stated.sigma_per_m or 0.0)
    return Cell(
        robot=preset(stated.robot).with_tool(stated.T_flange_tool),
        payload=Load(mass=np.array([stated.mass]), com=np.asarray(stated.centre)[None]),
        repeatability=stated.repeatability,
        frame=stated.frame,
        tracker=tracker,
    )


def preset_cell_text(stated: PresetCell) -> str:
    """Returns the cell.toml of the cell; reading it gives the same cell.

    Raises:
        ConfigurationError: As :func:`preset_cell`.
        ShapeError: As :func:`preset_cell`.
    """
    return FIRST_LINE + cell_text(preset_cell(stated)).removeprefix(HEADING)


USUAL: Final = {"sigma_um": DEFAULT_SPECIFICATION.range_bound / DEFAULT_SPECIFICATION.divisor / UM,
                "sigma_um_per_m": DEFAULT_SPECIFICATION.range_bound_per_m
                / DEFAULT_SPECIFICATION.divisor / UM,
                "repeatability_mm": 6e-5 / MM}  # fmt: skip
"""What a form shows first, in its units."""
