"""Files about places on a part: touched points, and features that could be touched.

Both are CSV, TSV or workbook; columns in any order: ``name``, ``px_mm, py_mm, pz_mm`` (nominal
point in the part), optionally ``nx, ny, nz`` (outward surface normal in the part: a touch fixes
only that direction; blank at a full point) and ``part`` (part or side the row belongs to).

Touched points, the file behind ``robotrue register``, also have either ``a1_deg, a2_deg, ...``
(axes at the touch, as the controller displays them), ``j1_deg, j2_deg, ...`` (joints of the robot
model) or ``x_mm, y_mm, z_mm`` (a measured point in base). Features may have ``ax, ay, az`` (outward
direction in the part from which the tool can come; blank: along the normal, or from anywhere); a
feature that can be reached from two directions has two rows of the same name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.csv_text import axis_names
from robotrue.core.files import read_bytes
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.canonical import (
    POSITION,
    axes_in,
    joint_names,
    joints_in,
)
from robotrue.measurement.formats.sheet import Sheet, number_columns, write_columns
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.formats.table import AxisRelation
from robotrue.measurement.probing_set import ProbingSet

POINT: Final = ("px_mm", "py_mm", "pz_mm")
NAMED: Final = ("name", *POINT)
NORMAL: Final = ("nx", "ny", "nz")
ACCESS: Final = ("ax", "ay", "az")
ONE_PART: Final = ("part",)
"""Names of the parts where a file names none."""
UNIT: Final = (0.5, 2.0)
"""Lengths a direction may have; outside it is a coordinate."""
FEATURES_EXAMPLE: Final = "name,px_mm,py_mm,pz_mm and, where needed, nx,ny,nz,ax,ay,az,part."
TOUCHES_EXAMPLE: Final = (
    "name,px_mm,py_mm,pz_mm,a1_deg,...,a6_deg (as displayed; j1_deg.. of the robot model) or "
    "name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm"
)
PLANNED: Final = "# planned joints, nothing was touched yet"
"""First line of a file of touches that were planned; the operator removes it after probing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Features(Columns):
    """n rows: places of a part that can be touched.

    Attributes:
        names: (n) of the features.
        point: (n, 3) m in part.
        normal: (n, 3) outward unit normal in part; NaN at a full point.
        access: (n, 3) unit direction in part from which the tool can come; NaN: any.
        part: (n,) number of the part.
        parts: Names of the parts by number.
        digest: SHA-256 of the file; empty if made in code.
    """

    names: Annotated[tuple[str, ...], Column("n")]
    point: Annotated[Array, Column("n 3", unit="m")]
    normal: Annotated[Array, Column("n 3", nan=True)]
    access: Annotated[Array, Column("n 3", nan=True)]
    part: Annotated[IntArray, Column("n")]
    parts: tuple[str, ...] = ONE_PART
    digest: str = ""

    def _check_rules(self) -> None:
        """Makes directions unit."""
        for name in ("normal", "access"):
            direction = getattr(self, name)
            self._set_column(name, direction / np.linalg.norm(direction, axis=1, keepdims=True))

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointsFile:
    """Content of a file of probing points.

    Attributes:
        touches: The rows.
        parts: Name of each part or side, by its number in ``touches.part``.
        digest: SHA-256 of the file.
    """

    touches: ProbingSet
    parts: tuple[str, ...]
    digest: str


def read_features(path: str | Path) -> Features:
    """Returns the features of a file.

    Raises:
        FormatError: A column is missing, unknown or incomplete, a cell is not a finite number, a
            direction is none; with its line.
    """
    sheet = read_sheet(path)
    sheet.check_columns((NAMED,), (NORMAL, ACCESS, ("part",)), FEATURES_EXAMPLE)
    parts, part = _read_parts(sheet)
    point, names = sheet.numbers(POINT) * MM, sheet.words("name")
    normal, access = (
        _read_directions(sheet, columns, ", ".join(columns), "a direction such as 0,0,1;")
        for columns in (NORMAL, ACCESS)
    )
    return Features(
        names=names,
        point=point,
        normal=normal,
        access=access,
        part=part,
        parts=parts,
        digest=sheet.digest,
    )


def read_points(path: str | Path, relation: AxisRelation | None = None) -> PointsFile:
    """Returns the touches of a file.

    Where a file has joints and measured points, the joints are used: they contain more information.

    Args:
        path: The file.
        relation: Takes the controller's axes to joints, for a file with such axes.

    Raises:
        FormatError: A column is missing, unknown or incomplete, a cell is not a finite number, a
            normal is no direction, axes of an unknown or another robot; with its line. The file is
            marked as a plan that was not probed yet.
    """
    sheet = read_sheet(path)
    if read_bytes(path).removeprefix(b"\xef\xbb\xbf").startswith(PLANNED.encode()):
        raise FormatError(
            "its joints are planned ones, nothing was touched yet.",
            source=path,
            line=1,
            hint="put the joints at each touch in their place, then delete this line.",
        )
    displayed = axis_names(axes_in(sheet.header))
    joints = displayed or joint_names(joints_in(sheet.header))
    optional = (NORMAL, ("part",))
    if joints:
        sheet.check_columns((NAMED,), (joints, POSITION, *optional), TOUCHES_EXAMPLE)
    else:
        sheet.check_columns(
            (NAMED, POSITION),
            (("a1_deg", "a2_deg", "..."), *optional),
            TOUCHES_EXAMPLE,
            lacking={POSITION[0]: "a1_deg.., j1_deg.. or x_mm, y_mm, z_mm"},
        )
    names, (parts, part) = sheet.words("name"), _read_parts(sheet)
    hint = "give the outward normal of the surface, e.g. 0,0,1;"
    touches = ProbingSet(
        names=names,
        point=sheet.numbers(POINT, named_by="name") * MM,
        joints=_read_joints(sheet, joints, relation if displayed else _as_stated),
        position=np.empty(0) if joints else sheet.numbers(POSITION, named_by="name") * MM,
        normal=_read_directions(sheet, NORMAL, "normal of {}", hint, named_by="name"),
        part=part,
        source=f"{Path(path).name} sha256:{sheet.digest}",
        lines=np.array(sheet.lines, dtype=np.int64),
        provenance=sheet.provenance,
    )
    return PointsFile(touches=touches, parts=parts, digest=sheet.digest)


def _as_stated(joints: Array) -> Array:
    """The relation of joints of the robot model."""
    return joints


def _read_joints(sheet: Sheet, names: Sequence[str], relation: AxisRelation | None) -> Array:
    if not names:
        return np.empty((0, 0))
    if relation is None:
        raise sheet.fault(
            f"columns {names[0]}.. are axes of a controller, and no robot states their convention.",
            "name joints of the robot model j1_deg, j2_deg, ...",
        )
    values = sheet.numbers(names, named_by="name") * DEG
    with suppress(ValueError):  # another number of axes
        joints = relation(values)
        if joints.shape == values.shape:
            return joints
    raise sheet.fault(
        f"{len(names)} columns of axes, the robot has another number.",
        "one column a1_deg, a2_deg, ... for each axis.",
    )


def _read_parts(sheet: Sheet) -> tuple[tuple[str, ...], IntArray]:
    """Names of the parts in the order they first appear, and each row's number."""
    if not sheet.has("part"):
        return ONE_PART, np.zeros(len(sheet), dtype=np.int64)
    words = sheet.words("part")
    parts = tuple(dict.fromkeys(words))
    return parts, np.array([parts.index(word) for word in words], dtype=np.int64)


def _read_directions(
    sheet: Sheet, names: Sequence[str], what: str, hint: str, *, named_by: str = ""
) -> Array:
    """Directions (n, 3) as printed; NaN in a row that leaves all three blank, or has no columns.

    Where a column names the rows, three zeros are no direction either, and no fault.
    """
    directions = np.full((len(sheet), 3), np.nan)
    if not sheet.has(names[0]):
        return directions
    filled = np.flatnonzero([any(row) for row in zip(*map(sheet.column, names), strict=True)])
    stated = sheet.take(filled)
    values = stated.numbers(names, named_by=named_by)
    length = np.linalg.norm(values, axis=1)
    zero = (length == 0.0) & bool(named_by)
    for row in np.flatnonzero(((length < UNIT[0]) | (length > UNIT[1])) & ~zero).tolist():
        raise stated.fault(
            f"{what.format(repr(stated.column('name')[row]))} has length {length[row]:g}, expected "
            f"a direction of length {UNIT[0]:g} to {UNIT[1]:g}.",
            f"{hint} not a point.",
            row=row,
        )
    directions[filled[~zero]] = values[~zero]
    return directions


def write_points(path: str | Path, touches: ProbingSet, parts: Sequence[str] = ()) -> None:
    """Writes touches of points and normals, whole or not at all; every number with all digits.

    Raises:
        FormatError: Touches that have no columns here (sockets, named surfaces), or no such folder.
    """
    if touches.sockets or touches.surfaces:
        raise FormatError(
            "sockets and named surfaces have no columns in a file of touched points.", source=path
        )
    write_columns(path, point_columns(touches, parts), touches.provenance)


def point_columns(
    touches: ProbingSet,
    parts: Sequence[str],
    written: Callable[[float], str] = repr,
    displayed: Array | None = None,
) -> dict[str, list[str]]:
    """Returns the columns of a file of touched points by name.

    Args:
        touches: Of points and normals.
        parts: Name of each part by its number; without any the column is left out.
        written: Text of a number; all its digits if not given.
        displayed: (n, dof) rad, axes as the controller displays them, in place of the joints.
    """
    if displayed is not None:
        axes, values = axis_names(displayed.shape[1]), displayed / DEG
    elif touches.has_joints:
        axes, values = joint_names(touches.joints.shape[1]), touches.joints / DEG
    else:
        axes, values = POSITION, touches.position / MM
    columns = {"name": list(touches.names)}
    columns |= number_columns(POINT, touches.point / MM, written)
    columns |= number_columns(axes, values, written)
    if not touches.full.all():
        columns |= number_columns(NORMAL, touches.normal, written)
    if parts:
        columns["part"] = [parts[int(k)] for k in touches.part]
    return columns
