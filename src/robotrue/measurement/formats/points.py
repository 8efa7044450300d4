"""Touched points as CSV, TSV or workbook: the file behind ``robotrue register``.

Columns, in any order: ``name``, ``px_mm, py_mm, pz_mm`` (nominal point in the part), and either
``j1_deg, j2_deg, ...`` (joints at the touch, in the robot model's sense) or ``x_mm, y_mm, z_mm`` (a
measured point in base). Optionally ``nx, ny, nz`` (surface normal in the part: the touch fixes only
that direction; blank in a row that is a full point) and ``part`` (part or side the row belongs to).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.provenance import mark_line
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.canonical import canonical_joints
from robotrue.measurement.formats.part_columns import NORMAL, POINT, read_part_sheet
from robotrue.measurement.probing_set import ProbingSet

POSITION: Final = ("x_mm", "y_mm", "z_mm")
EXAMPLE: Final = "name,px_mm,py_mm,pz_mm,j1_deg,...,j6_deg or name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm"
PLANNED: Final = "# planned joints, nothing was touched yet"
"""First line of a file of touches that were planned; who has touched takes it out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointsFile:
    """What a file of touched points holds.

    Attributes:
        touches: The rows.
        parts: Name of each part or side, by its number in ``touches.part``.
        digest: SHA-256 of the file.
    """

    touches: ProbingSet
    parts: tuple[str, ...]
    digest: str


def read_points(path: str | Path) -> PointsFile:
    """Returns the touches of a file.

    Where joints and measured points are both there, the joints are taken: they say more.

    Raises:
        FormatError: A column is missing, unknown or incomplete, a cell is not a finite number, a
            normal is no direction; with its line. The file says that nothing was touched yet.
    """
    columns = read_part_sheet(path)
    if read_bytes(path).removeprefix(b"\xef\xbb\xbf").startswith(PLANNED.encode()):
        raise FormatError(
            "its joints are planned ones, nothing was touched yet.",
            source=path,
            line=1,
            hint="put the joints at each touch in their place, then delete this line.",
        )
    sheet = columns.sheet
    joints = tuple(f"j{i + 1}_deg" for i in range(canonical_joints(sheet.header)))
    named = ("name", *POINT)
    if joints:
        columns.require((named,), (joints, POSITION, NORMAL, ("part",)), EXAMPLE)
    else:
        columns.require(
            (named, POSITION),
            (("j1_deg", "j2_deg", "..."), NORMAL, ("part",)),
            EXAMPLE,
            lacking={POSITION[0]: "j1_deg.. or x_mm, y_mm, z_mm"},
        )
    names = columns.words("name")
    parts, part = columns.parts()
    touches = ProbingSet(
        names=names,
        point=columns.numbers(POINT) * MM,
        joints=columns.numbers(joints) * DEG if joints else np.empty((0, 0)),
        position=np.empty(0) if joints else columns.numbers(POSITION) * MM,
        normal=columns.directions(
            NORMAL,
            "normal of {}",
            "give the outward normal of the surface, e.g. 0,0,1; not a point.",
            zero_is_blank=True,
        ),
        part=part,
        source=f"{Path(path).name} sha256:{sheet.digest}",
        lines=np.array(sheet.lines, dtype=np.int64),
        provenance=sheet.provenance,
    )
    return PointsFile(touches=touches, parts=parts, digest=sheet.digest)


def write_points(path: str | Path, touches: ProbingSet, parts: Sequence[str] = ()) -> None:
    """Writes touches of points and normals, whole or not at all; every number with all digits.

    Raises:
        FormatError: Touches that have no columns here (sockets, named surfaces), or no such folder.
    """
    if touches.sockets or touches.surfaces:
        raise FormatError(
            "sockets and named surfaces have no columns in a file of touched points.", source=path
        )
    columns: dict[str, list[str]] = {"name": list(touches.names)}
    columns |= _block(POINT, touches.point / MM)
    if touches.has_joints:
        names = tuple(f"j{i + 1}_deg" for i in range(touches.joints.shape[1]))
        columns |= _block(names, touches.joints / DEG)
    else:
        columns |= _block(POSITION, touches.position / MM)
    if not touches.full.all():
        columns |= _block(NORMAL, touches.normal)
    if parts:
        columns["part"] = [parts[int(k)] for k in touches.part]
    rows = zip(*columns.values(), strict=True)
    head = mark_line(touches.provenance)
    write_atomic(path, (head + csv_text(chain([columns], rows))).encode())


def _block(names: Sequence[str], values: Array) -> dict[str, list[str]]:
    return {
        name: ["" if np.isnan(v) else repr(float(v)) for v in values[:, i]]
        for i, name in enumerate(names)
    }
