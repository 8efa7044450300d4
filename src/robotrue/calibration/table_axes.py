"""Rotary axes of a cell in addition to those that a model was calibrated with.

The errors of a table count from the axis that the controller turns its frames about, so a cell that
states another one needs another calibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.terms.rail_guide import RailGuide
from robotrue.calibration.terms.rotary_table import AXIS, SIZE, RotaryTable
from robotrue.calibration.terms.term import Term
from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.table_set import TableSet
from robotrue.program.external_axes import ExternalAxis, plain_key

MOST_TILT: Final = 2e-3
MOST_OFFSET: Final = 5.0 * MM
"""rad and m, of the axis across its stated place: beyond, its motion is not linear to 10 um."""


def same_axis(one: ExternalAxis, other: ExternalAxis) -> bool:
    """Returns whether two descriptions mean the same rotation of what the axis carries."""
    if one.number != other.number or one.point is None or other.point is None:
        return False
    off = np.cross(one.direction, other.point - one.point)
    return (
        bool(np.allclose(one.direction, other.direction, rtol=0.0, atol=1e-9))
        and float(np.linalg.norm(off)) < 1e-8
        and abs(one.at - other.at) < 1e-9
    )


def find_axes_beside(axes: Sequence[ExternalAxis], used: Sequence[ExternalAxis]) -> tuple[int, ...]:
    """Returns the numbers of further rotary or linear axes that carry a frame of the used ones."""
    frames = {plain_key(name) for axis in used for name in axis.frames}
    numbers = {axis.number for axis in used}
    return tuple(
        axis.number
        for axis in axes
        if axis.number not in numbers and frames & {plain_key(name) for name in axis.frames}
    )


def require_table_axes(terms: Sequence[Term], axes: Sequence[ExternalAxis]) -> None:
    """Refuses a cell that states the rotary axes of a model otherwise than it was calibrated.

    Raises:
        ConfigurationError: An axis is stated elsewhere, or another one carries the same frames.
    """
    for term in terms:
        numbers = {axis.number for axis in term.axes} if isinstance(term, RotaryTable) else set()
        stated = [axis for axis in axes if axis.number in numbers]
        same = isinstance(term, RotaryTable) and all(
            any(same_axis(axis, known) for known in term.axes) for axis in stated
        )
        if stated and not (same and not find_axes_beside(axes, stated)):
            raise ConfigurationError(
                f"the model has a rotary table E{stated[0].number}, and the cell states its axes "
                "otherwise.",
                hint="use the cell it was calibrated with, whose about, through_mm, at_deg and "
                "carries its errors count from, or calibrate with --table again.",
            )


def require_axes(
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
