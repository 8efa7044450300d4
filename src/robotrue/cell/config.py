"""cell.toml: the one file that describes robot, tool and instrument. Keys are in docs/reference."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.cell.cell import DEFAULT_TARGET_SIGMA, Cell
from robotrue.cell.controller_table import read_controller
from robotrue.cell.obstacles import Box, HalfSpace, Obstacle, Sphere
from robotrue.cell.part import PartFrame, PartTable
from robotrue.cell.robot_table import read_compliance, read_robot
from robotrue.cell.schema import (
    CellFile,
    ObstacleTable,
    PartFrameTable,
    PayloadTable,
    PoseTable,
    TargetTable,
    TrackerTable,
)
from robotrue.core.arrays import Array
from robotrue.core.files import parse_toml, read_bytes, sha256
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.provenance import Provenance, SourceFile
from robotrue.core.schema_faults import check_tables, line_of_key
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, TrackerSpecification, one_sigma
from robotrue.robot.statics import Load

_LISTED: Final = re.compile(r"controller\.(\w+)(?:\[(\d+)\])?")


def read_cell(path: str | Path) -> Cell:
    """Returns the cell a TOML file describes.

    Raises:
        ConfigurationError: Not TOML, an unknown key, a value that is not allowed, no robot; with
            file, line and key.
        FormatError: The file, or one it names, cannot be read.
    """
    return parse_cell(read_bytes(path), path)


def parse_cell(data: bytes, path: str | Path, *, files: Mapping[str, bytes] | None = None) -> Cell:
    """Returns the cell the content of a file describes.

    Args:
        data: Content of the cell.toml.
        path: Its present or planned position.
        files: Content of the files it names (URDF, frames), by the names it gives them; None:
            they are read from the disk, relative to the path.

    Raises:
        ConfigurationError: As :func:`read_cell`.
        FormatError: As :func:`read_cell`.
    """
    tables, text = parse_toml(data, path, example="the reference of cell.toml")
    file = check_tables(CellFile, tables, path=path, text=text)
    try:
        return _build_cell(file, _Source(path=Path(path), text=text, data=data, files=files))
    except (ConfigurationError, ShapeError) as cause:
        if cause.source is not None:
            raise
        key = _find_key(cause.message, file)
        raise ConfigurationError(
            cause.message, source=path, line=line_of_key(text, key), hint=cause.hint
        ) from cause


class _Source:
    """The content of a cell.toml, and of the files it names as far as they were read."""

    def __init__(
        self, *, path: Path, text: str, data: bytes, files: Mapping[str, bytes] | None
    ) -> None:
        self.path, self.text, self.digest = path, text, sha256(data)
        self.read: dict[str, bytes] = {}
        self._files = files

    def read_file(self, name: str) -> bytes:
        """Returns the content of a file by the name that the cell.toml gives it.

        Raises:
            ConfigurationError: It is not among the files that came with the text.
            FormatError: It cannot be read.
        """
        if self._files is None:
            self.read[name] = read_bytes(self.path.parent / name)
        elif name in self._files:
            self.read[name] = self._files[name]
        else:  # never from the disk: the text may be of another computer, or forged
            raise ConfigurationError(
                f"the file {name!r} that the cell names did not come with it.",
                source=self.path,
                hint="make the model file again from the cell.toml and the files it names.",
            )
        return self.read[name]


def _find_key(message: str, file: CellFile) -> tuple[str | int, ...]:
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
        "ur_calibration",
        "preset",
        "link_radius",
        "mass_kg",
        "limits",
        "centre_of_mass",
        "stiffness",
        "gravity",
        "maker",
        "axes",
        "joint_map",
        "sigma",
    ):
        if name in message:
            owner = "tracker" if name == "sigma" else "robot"
            keys = getattr(file, owner).model_fields_set
            return (owner, *(key for key in sorted(keys) if key.startswith(name)))[:2]
    return ("robot", "dh") if file.robot.dh else ("robot",)


def _build_cell(file: CellFile, source: _Source) -> Cell:
    robot = read_robot(file.robot, source.path, source.read_file)
    if file.tool is not None:
        robot = robot.with_tool(_pose(file.tool))
    part, target, tracker = _read_part(file), file.target, file.tracker
    return Cell(
        robot=robot,
        T_flange_target=robot.T_flange_tool
        if target is None
        else pose(np.eye(3), np.array(target.xyz_mm) * MM),
        target_sigma=DEFAULT_TARGET_SIGMA if target is None else target.sigma_mm * MM,
        frame="base" if tracker.frame == "base" else "tracker",
        tracker_position=_point(tracker.xyz_mm),
        tracker_place=_point(tracker.place_mm),
        tracker=_tracker(tracker),
        target_axis=_target_axis(target),
        acceptance=np.pi
        if target is None or target.acceptance_deg is None
        else target.acceptance_deg * DEG,
        link_radius=_point(file.robot.link_radius_mm),
        obstacles=tuple(_obstacle(table, k) for k, table in enumerate(file.obstacle, start=1)),
        repeatability=file.repeatability.mm * MM,
        payload=_payload(file.payload),
        T_base_frame=_pose(file.base)
        if part is None or len(part.frames) > 1
        else part.frames[0].T_base_part,
        part=part,
        controller=read_controller(file.controller, source.read_file),
        compliance_prior=read_compliance(file.robot, robot.dof),
        tables=frozenset(file.model_fields_set),
        source=str(source.path),
        digest=source.digest,
        text=source.text,
        files=source.read,
    )


def _point(values_mm: list[float] | None) -> Array | None:
    return None if values_mm is None else np.array(values_mm) * MM


def _pose(table: PoseTable | PartFrameTable) -> Array:
    return pose_from_xyz_abc(np.array(table.xyz_mm) * MM, np.array(table.abc_deg) * DEG)


def _payload(table: PayloadTable) -> Load:
    return Load(mass=np.array([table.mass_kg]), com=np.array([table.centre_of_mass_mm]) * MM)


def _target_axis(table: TargetTable | None) -> Array | None:
    if table is None or (table.axis is None and table.acceptance_deg is None):
        return None
    if table.axis is None or not any(table.axis):
        raise ConfigurationError(
            "target.acceptance_deg needs target.axis, the direction of the reflector, which "
            "cannot be zero.",
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
    specification = one_sigma(fixed * UM, slope * UM)
    return replace(specification, name=table.name) if table.name else specification


def _read_part(file: CellFile) -> PartTable | None:
    """Returns where touching found the part; None in a cell that is not registered.

    Raises:
        ConfigurationError: Frames without what they were made with, or the reverse, or two of one
            name.
    """
    if file.registration is None and not file.part:
        return None
    names = [table.name for table in file.part]
    if file.registration is None or not names or len(set(names)) < len(names):
        raise ConfigurationError(
            f"part frames {names} {'without' if file.registration is None else 'with'} a "
            "[registration], expected one table [registration] and one or more [[part]], of "
            "different names.",
            hint="robotrue register CELL POINTS -o CELL_OUT writes both.",
        )
    made = file.registration
    return PartTable(
        frames=tuple(_read_frame(table) for table in file.part),
        identity=ModelIdentity(
            kind=made.model.kind, robot=made.model.robot, sha256=made.model.sha256
        ),
        method=made.method,
        model_file=made.model.file,
        points_file=made.points_file,
        points_sha256=made.points_sha256,
        provenance=Provenance(
            simulated=made.simulated,
            instrument=made.instrument,
            files=(SourceFile(name=made.points_file, sha256=made.points_sha256),)
            if made.points_file
            else (),
        ),
    )


def _read_frame(table: PartFrameTable) -> PartFrame:
    return PartFrame(
        name=table.name,
        T_base_part=_pose(table),
        covariance=np.array(table.covariance_m_rad),
        touches=table.touches,
        outliers=tuple(table.outliers),
        rms=table.rms_mm * MM,
        verdict=table.verdict,
    )
