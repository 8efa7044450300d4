"""cell.toml: the one file that says which robot stands where. Keys are in docs/reference."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from robotrue.cell.cell import DEFAULT_TARGET_SIGMA, Cell
from robotrue.cell.controller import controller_of
from robotrue.cell.obstacles import Box, HalfSpace, Obstacle, Sphere
from robotrue.cell.part_tables import part_of
from robotrue.cell.schema import (
    CellFile,
    DhRow,
    ObstacleTable,
    PayloadTable,
    PoseTable,
    RobotTable,
    TargetTable,
    TrackerTable,
)
from robotrue.cell.wording import configuration_error, line_of_key
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes, sha256
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.toml_text import parse_toml
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, TrackerSpecification, one_sigma
from robotrue.robot.makers import made_by
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

_REACH: Final = (0.05, 20.0)
"""m; a DH table outside is in another unit."""
_LISTED: Final = re.compile(r"controller\.(\w+)(?:\[(\d+)\])?")


def read_cell(path: str | Path) -> Cell:
    """Returns the cell a TOML file describes.

    Raises:
        ConfigurationError: Not TOML, an unknown key, a value that is not allowed, no robot; with
            file, line and key.
        FormatError: The file cannot be read.
    """
    return parse_cell(read_bytes(path), path)


def parse_cell(data: bytes, path: str | Path) -> Cell:
    """Returns the cell the content of a file describes; the path is where it stands, or will.

    Raises:
        ConfigurationError: As :func:`read_cell`.
    """
    tables, text = parse_toml(data, path, example="the reference of cell.toml")
    try:
        file = CellFile.model_validate(tables)
    except ValidationError as cause:
        raise configuration_error(cause, tables, path=path, text=text) from None
    try:
        return _cell(file, path, sha256(data))
    except (ConfigurationError, ShapeError) as cause:
        if cause.source is not None:
            raise
        key = _blamed(cause.message, file)
        raise ConfigurationError(
            cause.message, source=path, line=line_of_key(text, key), hint=cause.hint
        ) from cause


def _blamed(message: str, file: CellFile) -> tuple[str | int, ...]:
    """Returns the key a message is about, for its line."""
    listed = _LISTED.match(message)
    if listed:
        return ("controller", listed[1], *((int(listed[2]) - 1,) if listed[2] else ()))
    for k, table in enumerate(file.obstacle):
        if f"obstacle {table.name or f'obstacle {k + 1}'!r}" in message:
            return ("obstacle", k)
    if "target.a" in message:
        return ("target",)
    for name in (
        "preset",
        "link_radius",
        "mass_kg",
        "limits",
        "centre_of_mass",
        "stiffness",
        "gravity",
        "maker",
        "axes",
        "sigma",
    ):
        if name in message:
            owner = "tracker" if name == "sigma" else "robot"
            keys = getattr(file, owner).model_fields_set
            return (owner, *(key for key in sorted(keys) if key.startswith(name)))[:2]
    return ("robot", "dh") if file.robot.dh else ("robot",)


def _cell(file: CellFile, path: str | Path, digest: str) -> Cell:
    robot = _robot(file.robot, Path(path))
    if file.tool is not None:
        robot = robot.with_tool(_pose(file.tool))
    prior, doubts = _stiffness(file.robot, robot), []
    part = part_of(file)
    if not robot.link_mass.any():
        doubts.append(
            "No link masses are given: bending under the arm's own weight cannot be modelled, "
            "only under payload and wrench."
        )
    return Cell(
        robot=robot,
        T_flange_target=pose(np.eye(3), np.array(file.target.xyz_mm) * MM)
        if file.target is not None
        else robot.T_flange_tool,
        target_sigma=DEFAULT_TARGET_SIGMA if file.target is None else file.target.sigma_mm * MM,
        frame="base" if file.tracker.frame == "base" else "tracker",
        tracker_position=None
        if file.tracker.xyz_mm is None
        else np.array(file.tracker.xyz_mm) * MM,
        tracker_place=None
        if file.tracker.place_mm is None
        else np.array(file.tracker.place_mm) * MM,
        tracker=_tracker(file.tracker),
        target_axis=_target_axis(file.target),
        acceptance=np.pi
        if file.target is None or file.target.acceptance_deg is None
        else file.target.acceptance_deg * DEG,
        link_radius=None
        if file.robot.link_radius_mm is None
        else np.array(file.robot.link_radius_mm) * MM,
        obstacles=tuple(_obstacle(table, k) for k, table in enumerate(file.obstacle, start=1)),
        repeatability=file.repeatability.mm * MM,
        payload=_payload(file.payload),
        T_base_frame=_pose(file.base)
        if part is None or len(part.frames) > 1
        else part.frames[0].T_base_part,
        part=part,
        controller=controller_of(file.controller, Path(path).parent),
        compliance_prior=prior,
        doubts=tuple(doubts),
        tables=frozenset(file.model_fields_set),
        source=str(path),
        digest=digest,
    )


def _robot(table: RobotTable, path: Path) -> RobotModel:
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

        robot = from_urdf(path.parent / table.urdf)
    else:
        robot = _from_dh(table, path)
    return _counted(_with_lists(robot, table), table)


def _counted(robot: RobotModel, table: RobotTable) -> RobotModel:
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
    return made_by(
        robot,
        table.maker or robot.maker,
        sign=None if sign is None else np.array(sign, dtype=np.float64),
        offset=None if offset is None else np.array(offset) * DEG,
    )


def _from_dh(table: RobotTable, path: Path) -> RobotModel:
    rows: list[DhRow] = table.dh or []
    robot = RobotModel(
        name=path.stem,
        convention=table.convention or "dh",
        theta=np.array([row.theta_deg for row in rows]) * DEG,
        alpha=np.array([row.alpha_deg for row in rows]) * DEG,
        d=np.array([row.d_mm for row in rows]) * MM,
        a=np.array([row.a_mm for row in rows]) * MM,
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
    changes: dict[str, Any] = {}
    for key in (
        "limits_deg",
        "mass_kg",
        "centre_of_mass_mm",
        "stiffness_Nm_per_rad",
        "link_radius_mm",
        "axes_sign",
        "axes_offset_deg",
    ):
        values = getattr(table, key)
        if values is not None and len(values) != robot.dof:
            raise ConfigurationError(
                f"robot.{key} has {len(values)} entries, the robot {robot.dof} joints."
            )
    if table.limits_deg is not None:
        changes["limits"] = np.array(table.limits_deg) * DEG
    if table.mass_kg is not None:
        changes["link_mass"] = np.array(table.mass_kg)
    if table.centre_of_mass_mm is not None:
        changes["link_com"] = np.array(table.centre_of_mass_mm) * MM
    if table.gravity_m_per_s2 is not None:
        changes["gravity"] = _gravity(np.array(table.gravity_m_per_s2))
    return replace(robot, **changes)


def _gravity(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    if length != 0.0 and not 9.7 <= length <= 9.9:
        raise ConfigurationError(
            f"robot.gravity_m_per_s2 has length {length:g} m/s^2, expected 9.7 to 9.9 (or 0).",
            hint="[0, 0, -9.80665] for a robot that stands on the floor.",
        )
    return vector


def _stiffness(table: RobotTable, robot: RobotModel) -> Array:
    if table.stiffness_Nm_per_rad is None:
        return np.full(robot.dof, np.nan)
    return 1.0 / np.array(table.stiffness_Nm_per_rad)


def _pose(table: PoseTable) -> Array:
    return pose_from_xyz_abc(np.array(table.xyz_mm) * MM, np.array(table.abc_deg) * DEG)


def _payload(table: PayloadTable) -> Load:
    return Load(mass=np.array([table.mass_kg]), com=np.array([table.centre_of_mass_mm]) * MM)


def _target_axis(table: TargetTable | None) -> Array | None:
    if table is None or (table.axis is None and table.acceptance_deg is None):
        return None
    if table.axis is None or not any(table.axis):
        raise ConfigurationError(
            "target.acceptance_deg needs target.axis, the way the reflector looks, and that cannot "
            "be zero.",
            hint="axis = [0, 0, 1] for a reflector that looks away from the flange.",
        )
    return np.array(table.axis)


def _obstacle(table: ObstacleTable, number: int) -> Obstacle:
    name = table.name or f"obstacle {number}"
    kinds = [k for k in ("box_mm", "sphere_mm", "below_mm") if getattr(table, k) is not None]
    if len(kinds) != 1:
        raise ConfigurationError(
            f"obstacle {name!r} gives {' and '.join(kinds) or 'no shape'}, expected exactly one of "
            "box_mm, sphere_mm, below_mm.",
            hint="below_mm = [[0, 0, -10], [0, 0, 1]] is the floor.",
        )
    if table.box_mm is not None:
        corners = np.array(table.box_mm) * MM
        return Box(name=name, low=corners.min(axis=0), high=corners.max(axis=0))
    if table.sphere_mm is not None:
        values = np.array(table.sphere_mm) * MM
        return Sphere(name=name, centre=values[:3], radius=float(values[3]))
    point, normal = np.array(table.below_mm)
    return HalfSpace(name=name, point=point * MM, normal=normal)


def _tracker(table: TrackerTable) -> TrackerSpecification:
    if table.sigma_um is None and table.sigma_um_per_m is None:
        return DEFAULT_SPECIFICATION
    fixed, slope = table.sigma_um or 0.0, table.sigma_um_per_m or 0.0
    if math.isclose(fixed + slope, 0.0):
        raise ConfigurationError(
            "tracker.sigma_um and tracker.sigma_um_per_m are both 0: no instrument is exact.",
            hint="a laser tracker has about 7.5 um + 2.5 um/m.",
        )
    return one_sigma(fixed * UM, slope * UM)
