"""A cell as the text of a cell.toml: the user's own where there is one."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.cell.cell import DEFAULT_TARGET_SIGMA, Cell
from robotrue.cell.config import parse_cell
from robotrue.cell.controller_table import controller_table
from robotrue.cell.obstacles import Box, Obstacle, Sphere
from robotrue.cell.robot_table import robot_table
from robotrue.cell.toml_edit import (
    plain_names,
    pose_keys,
    round_digits,
    with_table,
    without_part,
    write_toml,
)
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, TrackerSpecification, one_sigma

HEADING: Final = "# Written by robotrue from the cell kept in a model file.\n"


def cell_text(cell: Cell) -> str:
    """Returns the values of a cell as TOML that names no file; equal cells give equal text.

    Every number has 12 decimals, in the units of the file. Part frames are left out: they belong to
    the model that touched the part.

    Raises:
        ConfigurationError: An instrument whose error along and across the line of sight differs.
    """
    return HEADING + write_toml(_cell_tables(cell))


def portable_text(cell: Cell) -> tuple[str, dict[str, bytes]]:
    """Returns the cell.toml that goes with a model of the arm, and the files it names.

    That is the user's own text, comments and order included, unless values were changed since it
    was read: then, and for a cell made in code, it is written from the values. Names lose their
    folders. Part frames are left out: they belong to the model that touched the part; where
    programs ran in one, it stays as ``[base]``.

    Raises:
        ConfigurationError: As :func:`cell_text`.
    """
    values = cell_text(replace(cell, part=None))
    if not cell.text:
        return values, {}
    text = cell.text
    if cell.part is not None:
        text = with_table(without_part(text), "base", pose_keys(cell.T_base_frame))
    text, stated = plain_names(text)
    files = {name: cell.files[own] for name, own in stated.items()}
    if cell_text(parse_cell(text.encode(), cell.source, files=files)) != values:
        return values, {}
    return text, files


def _cell_tables(cell: Cell) -> dict[str, object]:
    tables: dict[str, object] = {
        "schema": 1,
        "robot": robot_table(cell.robot, cell.compliance_prior, cell.link_radius),
        "tool": pose_keys(cell.robot.T_flange_tool),
        "payload": {
            "mass_kg": round_digits(cell.payload.mass[0]),
            "centre_of_mass_mm": round_digits(cell.payload.com[0] / MM),
        },
        "repeatability": {"mm": round_digits(cell.repeatability / MM)},
    }
    if (
        cell.target_sigma != DEFAULT_TARGET_SIGMA
        or cell.target_axis is not None
        or not np.array_equal(cell.T_flange_target, cell.robot.T_flange_tool)
    ):
        tables["target"] = _target_table(cell)
    if not np.array_equal(cell.T_base_frame, np.eye(4)) and cell.part is None:
        tables["base"] = pose_keys(cell.T_base_frame)
    tables["tracker"] = _tracker_table(cell)
    if cell.obstacles:
        tables["obstacle"] = [_obstacle_table(body) for body in cell.obstacles]
    if cell.says_of_controller:
        tables["controller"] = controller_table(cell.controller)
    return tables


def _target_table(cell: Cell) -> dict[str, object]:
    table = {
        "xyz_mm": round_digits(cell.T_flange_target[:3, 3] / MM),
        "sigma_mm": round_digits(cell.target_sigma / MM),
    }
    if cell.target_axis is not None:
        table["axis"] = round_digits(cell.target_axis)
        if cell.acceptance < np.pi:
            table["acceptance_deg"] = round_digits(cell.acceptance / DEG)
    return table


def _tracker_table(cell: Cell) -> dict[str, object]:
    position, place = cell.tracker_position, cell.tracker_place
    table: dict[str, object] = {"frame": "base" if cell.frame == "base" else "unknown"}
    if position is not None and (cell.frame == "base" or np.any(position != 0.0)):
        table["xyz_mm"] = round_digits(position / MM)
    implied = cell.frame == "base" and position is not None
    if place is not None and not (implied and np.array_equal(place, np.asarray(position))):
        table["place_mm"] = round_digits(place / MM)
    return table | _sigma_keys(cell.tracker)


def _sigma_keys(tracker: TrackerSpecification) -> dict[str, object]:
    if tracker == DEFAULT_SPECIFICATION:
        return {}
    along = (tracker.range_bound, tracker.range_bound_per_m)
    if along != (tracker.angle_bound, tracker.angle_bound_per_m):
        raise ConfigurationError(
            f"tracker {tracker.name!r} has one bound along and another across the line of sight, "
            "which cell.toml cannot hold.",
            hint="one_sigma(sigma, sigma_per_m) of robotrue.measurement.tracker.",
        )
    sigma, per_m = (float(bound) / tracker.divisor for bound in along)
    keys = {"sigma_um": round_digits(sigma / UM), "sigma_um_per_m": round_digits(per_m / UM)}
    return keys | ({} if tracker.name == one_sigma(1.0).name else {"name": tracker.name})


def _obstacle_table(body: Obstacle) -> dict[str, object]:
    if isinstance(body, Box):
        shape = {"box_mm": round_digits(np.array([body.low, body.high]) / MM)}
    elif isinstance(body, Sphere):
        shape = {"sphere_mm": round_digits(np.append(body.centre, body.radius) / MM)}
    else:
        shape = {"below_mm": [round_digits(body.point / MM), round_digits(body.normal)]}
    return {"name": body.name, **shape}
