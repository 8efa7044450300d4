"""Rotary axes of a cell that a calibration of its table can use, and the limits of their error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.terms.rail_guide import RailGuide
from robotrue.calibration.terms.rotary_table import (
    AXIS,
    SIZE,
    RotaryTable,
    find_axes_beside,
)
from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.table_set import TableSet
from robotrue.program.external_axes import ExternalAxis

MOST_TILT: Final = 2e-3
MOST_OFFSET: Final = 5.0 * MM
"""rad and m, of the axis across its stated place; beyond, its motion is not linear to 10 um."""


def choose_axes(
    model: CalibratedModel, rows: TableSet, axes: Sequence[ExternalAxis]
) -> tuple[ExternalAxis, ...]:
    """Returns the axes that the rows state, from the floor up."""
    stated = (np.flatnonzero(np.isfinite(rows.external).all(axis=0)) + 1).tolist()
    by_number = {axis.number: axis for axis in axes}
    for number in stated:
        axis = by_number.get(number)
        if axis is None or axis.point is None:
            what = "does not describe it" if axis is None else "describes it as a linear one"
            raise ConfigurationError(
                f"the points state E{number} in deg, and the cell {what}.",
                source=rows.source or None,
                hint="[[controller.external]]: axis, about, through_mm, carries.",
            )
    if any(axis.carries_robot for axis in axes) or any(
        isinstance(term, RailGuide) for term in model.terms
    ):
        raise ConfigurationError(
            "the arm is on a rail: a rotary table beside a rail is not supported.",
            source=rows.source or None,
            hint="calibrate the rail without --table, or the arm and table at one place of the "
            "rail, in a cell without it.",
        )
    if model.root is None and model.reflectors:
        raise ConfigurationError(
            "the model has several reflectors and was fitted by a method without error terms.",
            source=rows.source or None,
            hint="--method auto, ripple or gp.",
        )
    used = tuple(axis for axis in axes if axis.number in stated)
    beside = find_axes_beside(axes, used)
    if beside or not used:
        raise ConfigurationError(
            f"the points do not state E{beside[0]}, which carries the same frames."
            if beside
            else "no angle is stated with every point.",
            source=rows.source or None,
            hint="a column e1_deg, e2_deg ... of every axis that turns the points.",
        )
    return used


def require_small(term: RotaryTable, values: Array) -> None:
    """Refuses an axis whose motion is not linear in where it is.

    Raises:
        ConfigurationError: It is too far from its stated place.
    """
    for k, axis in enumerate(term.axes):
        part = values[k * SIZE : k * SIZE + len(AXIS)]
        tilt, offset = float(np.linalg.norm(part[:2])), float(np.linalg.norm(part[2:4]))
        if tilt <= MOST_TILT and offset <= MOST_OFFSET:
            continue
        direction, point = term.actual_axis(k, values)
        raise ConfigurationError(
            f"the axis of E{axis.number} is {offset / MM:.2f} mm off and {tilt / 1e-3:.2f} mrad "
            f"tilted against the cell; at most {MOST_OFFSET / MM:.0f} mm and "
            f"{MOST_TILT / 1e-3:.0f} mrad can be compensated.",
            hint="calibrate the axis at the controller and state its values in the cell, near "
            f"about = {direction.round(6).tolist()}, through_mm = "
            f"{(point / MM).round(3).tolist()}.",
        )
