"""``[robot]`` of a cell.toml: a preset, a URDF file or a DH table, and what differs from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.cell.schema import RobotTable
from robotrue.cell.toml_edit import round_digits
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.robot.makers import MAKERS, apply_maker
from robotrue.robot.model import RobotModel, same_geometry
from robotrue.robot.presets import preset, preset_names, read_dh
from robotrue.robot.ur_calibration import read_ur_calibration

_REACH: Final = (0.05, 20.0)
"""m; a DH table outside is in another unit."""


def read_robot(table: RobotTable, path: Path, read_file: Callable[[str], bytes]) -> RobotModel:
    """Returns the nominal arm that the table describes.

    Args:
        table: As checked against the schema.
        path: Of the cell file; names the arm of a DH table.
        read_file: Returns the content of a file by the name that the cell file gives it.

    Raises:
        ConfigurationError: No geometry or two; lists of a wrong length; lengths in a wrong unit.
        FormatError: The file of a URDF or of a factory calibration cannot be read.
    """
    origins = [name for name in ("preset", "urdf", "dh") if getattr(table, name) is not None]
    if len(origins) != 1 or (table.dh is None) != (table.convention is None):
        given = [*origins, *(("convention",) if table.convention else ())]
        raise ConfigurationError(
            f"[robot] gives {' and '.join(given) or 'no geometry'}, expected exactly one of: "
            "preset; urdf; convention with dh.",
            hint='preset = "KUKA KR160 R1570".',
        )
    if table.preset is not None:
        robot = preset(table.preset)
    elif table.urdf is not None:
        from robotrue.robot.urdf import from_urdf  # reads XML; most cells do not need it

        robot = from_urdf(path.parent / table.urdf, data=read_file(table.urdf))
    else:
        robot = _from_dh(table, path)
    robot = _count_axes(_with_lists(robot, table), table)
    if table.ur_calibration is None:
        return robot
    data = read_file(table.ur_calibration)
    return read_ur_calibration(robot, data, path.parent / table.ur_calibration)


def _count_axes(robot: RobotModel, table: RobotTable) -> RobotModel:
    """The arm with its maker, and the way its controller counts the axes."""
    sign, offset = table.axes_sign, table.axes_offset_deg
    if table.maker is None and sign is None and offset is None:
        return robot
    if table.preset is not None:
        if table.maker in (None, robot.maker) and sign is None and offset is None:
            return robot
        raise ConfigurationError(
            f"robot.maker, axes_sign and axes_offset_deg beside preset {robot.name!r}, which has "
            f"its own (maker {robot.maker!r}).",
            hint="leave them out.",
        )
    return apply_maker(
        robot,
        table.maker or robot.maker,
        sign=None if sign is None else np.array(sign, dtype=np.float64),
        offset=None if offset is None else np.array(offset) * DEG,
    )


def _from_dh(table: RobotTable, path: Path) -> RobotModel:
    theta, alpha, d, a, beta = read_dh([row.model_dump() for row in table.dh or []])
    robot = RobotModel(
        name=path.stem,
        convention=table.convention or "dh",
        theta=theta,
        alpha=alpha,
        d=d,
        a=a,
        beta=beta,
        joint_map=np.empty((0, 0)) if table.joint_map is None else np.array(table.joint_map),
    )
    low, high = _REACH
    if not low <= robot.reach <= high:
        unit = "metres" if robot.reach < low else "micrometres"
        raise ConfigurationError(
            f"the DH lengths add up to {robot.reach / MM:g} mm, expected {low / MM:g} to "
            f"{high / MM:g} mm.",
            hint=f"check whether d_mm and a_mm were written in {unit}.",
        )
    return robot


def _with_lists(robot: RobotModel, table: RobotTable) -> RobotModel:
    for key in (
        "limits_deg",
        "mass_kg",
        "centre_of_mass_mm",
        "stiffness_Nm_per_rad",
        "link_radius_mm",
        "axes_sign",
        "axes_offset_deg",
        "joint_map",
    ):
        values = getattr(table, key)
        if values is not None and len(values) != robot.dof:
            raise ConfigurationError(
                f"robot.{key} has {len(values)} entries, the robot {robot.dof} joints."
            )
    if table.joint_map is not None and table.dh is None:
        raise ConfigurationError("robot.joint_map is given without dh.", hint="leave it out.")
    limits, mass, centre = table.limits_deg, table.mass_kg, table.centre_of_mass_mm
    gravity = table.gravity_m_per_s2
    return replace(
        robot,
        limits=robot.limits if limits is None else np.array(limits) * DEG,
        total_mass=robot.total_mass if table.total_mass_kg is None else table.total_mass_kg,
        link_mass=robot.link_mass if mass is None else np.array(mass),
        link_com=robot.link_com if centre is None else np.array(centre) * MM,
        gravity=robot.gravity if gravity is None else _gravity(np.array(gravity)),
    )


def _gravity(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    if length != 0.0 and not 9.7 <= length <= 9.9:
        raise ConfigurationError(
            f"robot.gravity_m_per_s2 has length {length:g} m/s^2, expected 9.7 to 9.9 (or 0).",
            hint="[0, 0, -9.80665] for a robot on the floor.",
        )
    return vector


def read_compliance(table: RobotTable, dof: int) -> Array:
    """Returns one over the stated joint stiffness, (dof,) rad/(N m); NaN where none is stated."""
    if table.stiffness_Nm_per_rad is None:
        return np.full(dof, np.nan)
    return 1.0 / np.array(table.stiffness_Nm_per_rad)


def robot_table(
    robot: RobotModel, compliance: Array, link_radius: Array | None
) -> dict[str, object]:
    """Returns the table that describes a nominal arm: its preset, or its DH table.

    Args:
        robot: The arm; its tool is not part of the table.
        compliance: (dof,) rad/(N m), NaN where not stated.
        link_radius: (dof,) m, or not known.
    """
    base = _like_preset(robot)
    table: dict[str, object] = _geometry(robot) if base is None else {"preset": base.name}
    for key, values, known, unit in (
        ("limits_deg", robot.limits, None if base is None else base.limits, DEG),
        ("mass_kg", robot.link_mass, None if base is None else base.link_mass, 1.0),
        ("centre_of_mass_mm", robot.link_com, None if base is None else base.link_com, MM),
    ):
        if known is None or not np.array_equal(values, known):
            table[key] = round_digits(values / unit)
    if robot.total_mass != (0.0 if base is None else base.total_mass):
        table["total_mass_kg"] = robot.total_mass
    if base is None or not np.array_equal(robot.gravity, base.gravity):
        table["gravity_m_per_s2"] = round_digits(robot.gravity)
    if np.isfinite(compliance).any():
        table["stiffness_Nm_per_rad"] = round_digits(1.0 / compliance)
    if link_radius is not None:
        table["link_radius_mm"] = round_digits(link_radius / MM)
    return table


def _like_preset(robot: RobotModel) -> RobotModel | None:
    """Returns the preset with this arm's geometry, maker and count of joints."""
    if robot.name not in preset_names():
        return None
    known = preset(robot.name)
    same = same_geometry(known, robot) and known.maker == robot.maker
    return known if same and _counting(known) == _counting(robot) else None


def _counting(robot: RobotModel) -> tuple[list[float], list[float]]:
    return robot.controller.sign.tolist(), robot.controller.offset.tolist()


def _geometry(robot: RobotModel) -> dict[str, object]:
    columns = [
        ("theta_deg", robot.theta / DEG),
        ("alpha_deg", robot.alpha / DEG),
        ("d_mm", robot.d / MM),
        ("a_mm", robot.a / MM),
    ]
    if robot.beta.any():
        columns.append(("beta_deg", robot.beta / DEG))
    rows = [{key: round_digits(values[i]) for key, values in columns} for i in range(robot.dof)]
    table: dict[str, object] = {"convention": robot.convention, "dh": rows}
    if not np.array_equal(robot.joint_map, np.eye(robot.dof)):
        table["joint_map"] = round_digits(robot.joint_map)
    named = robot.maker in MAKERS
    if named:
        table["maker"] = robot.maker
    sign, offset = _counting(robot)
    if named or (sign, offset) != ([1.0] * robot.dof, [0.0] * robot.dof):
        table["axes_sign"] = [int(s) for s in sign]
        table["axes_offset_deg"] = round_digits(np.array(offset) / DEG)
    return table
