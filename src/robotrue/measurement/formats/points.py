"""Touched points as CSV, TSV or workbook: the file behind ``robotrue register``.

Columns, in any order: ``name``, ``px_mm, py_mm, pz_mm`` (nominal point in the part), and either
``j1_deg, j2_deg, ...`` (joints at the touch, in the robot model's sense) or ``x_mm, y_mm, z_mm`` (a
measured point in base). Optionally ``nx, ny, nz`` (surface normal in the part: the touch fixes only
that direction; blank in a row that is a full point) and ``part`` (part or side the row belongs to).
"""

from __future__ import annotations

import difflib
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
from robotrue.measurement.formats.sheet import Sheet, column_key, finite_number, read_sheet
from robotrue.measurement.probing_set import ProbingSet

POINT: Final = ("px_mm", "py_mm", "pz_mm")
POSITION: Final = ("x_mm", "y_mm", "z_mm")
NORMAL: Final = ("nx", "ny", "nz")
EXAMPLE: Final = "name,px_mm,py_mm,pz_mm,j1_deg,...,j6_deg or name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm"
PLANNED: Final = "# planned joints, nothing was touched yet"
"""First line of a file of touches that were planned; who has touched takes it out."""
UNIT: Final = (0.5, 2.0)
"""Lengths a normal may have; outside it is no direction but a coordinate."""


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
    sheet = read_sheet(path)
    if read_bytes(path).removeprefix(b"\xef\xbb\xbf").startswith(PLANNED.encode()):
        raise FormatError(
            "its joints are planned ones, nothing was touched yet.",
            source=path,
            line=1,
            hint="put the joints at each touch in their place, then delete this line.",
        )
    keys = {column_key(name): i for i, name in enumerate(sheet.header)}
    joints = tuple(f"j{i + 1}_deg" for i in range(canonical_joints(sheet.header)))
    _check_columns(sheet, keys, joints)
    named = _words(sheet, keys["name"], "name")
    parts, part = _parts(sheet, keys)
    touches = ProbingSet(
        names=named,
        point=_numbers(sheet, keys, POINT) * MM,
        joints=_numbers(sheet, keys, joints) * DEG if joints else np.empty((0, 0)),
        position=_numbers(sheet, keys, POSITION) * MM
        if not joints
        else np.full((len(named), 3), np.nan),
        normal=_normals(sheet, keys) if set(NORMAL) <= set(keys) else np.empty(0),
        part=np.array(part, dtype=np.int64),
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


def _check_columns(sheet: Sheet, keys: dict[str, int], joints: Sequence[str]) -> None:
    known = ["name", "part", *POINT, *POSITION, *NORMAL, *joints]
    for name in sheet.header:
        if column_key(name) not in known:
            near = difflib.get_close_matches(column_key(name), known, n=1, cutoff=0.6)
            raise FormatError(
                f"unknown column {name!r}; allowed are name, px_mm, py_mm, pz_mm, j1_deg, j2_deg, "
                "..., x_mm, y_mm, z_mm, nx, ny, nz, part.",
                source=sheet.source,
                line=sheet.header_line,
                hint=f"rename it to {near[0]!r}, or remove it." if near else "remove the column.",
            )
    for group, needed in (
        (("name", *POINT), True),
        (tuple(joints), False),
        (POSITION, not joints),
        (NORMAL, False),
    ):
        missing = [name for name in group if name not in keys]
        if missing and (needed or len(missing) < len(group)):
            lacking = "j1_deg.. or x_mm, y_mm, z_mm" if group == POSITION else ", ".join(missing)
            raise FormatError(
                f"no column {lacking}; the file has {', '.join(sheet.header)}.",
                source=sheet.source,
                line=sheet.header_line,
                hint=EXAMPLE,
            )


def _words(sheet: Sheet, column: int, name: str) -> tuple[str, ...]:
    for row, line in zip(sheet.cells, sheet.lines, strict=True):
        if not row[column]:
            raise FormatError(
                f"column {name!r} is blank, expected a name.", source=sheet.source, line=line
            )
    return tuple(row[column] for row in sheet.cells)


def _parts(sheet: Sheet, keys: dict[str, int]) -> tuple[tuple[str, ...], list[int]]:
    """Names of the parts in the order they first appear, and the number of each row."""
    if "part" not in keys:
        return ("part",), [0] * len(sheet.cells)
    words = _words(sheet, keys["part"], "part")
    parts = tuple(dict.fromkeys(words))
    return parts, [parts.index(word) for word in words]


def _numbers(sheet: Sheet, keys: dict[str, int], names: Sequence[str]) -> Array:
    """Returns columns (n, k), every value finite."""
    return np.array(
        [
            [finite_number(sheet, row, keys[name], of=cells[keys["name"]]) for name in names]
            for row, cells in enumerate(sheet.cells)
        ]
    )


def _normals(sheet: Sheet, keys: dict[str, int]) -> Array:
    """Returns normals (n, 3); NaN in a row that leaves all three blank or zero."""
    out = np.full((len(sheet.cells), 3), np.nan)
    for row, cells in enumerate(sheet.cells):
        if not any(cells[keys[name]] for name in NORMAL):
            continue
        touch = cells[keys["name"]]
        normal = np.array([finite_number(sheet, row, keys[name], of=touch) for name in NORMAL])
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            continue
        if not UNIT[0] <= length <= UNIT[1]:
            raise FormatError(
                f"normal of {touch!r} has length {length:g}, expected "
                f"a direction of length {UNIT[0]:g} to {UNIT[1]:g}.",
                source=sheet.source,
                line=sheet.lines[row],
                hint="give the outward normal of the surface, e.g. 0,0,1; not a point.",
            )
        out[row] = normal
    return out
