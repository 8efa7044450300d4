"""Features of a part that could be touched, as CSV, TSV or workbook.

Columns, in any order: ``name``, ``px_mm, py_mm, pz_mm`` (nominal point in the part), optionally
``nx, ny, nz`` (outward normal in the part, of a surface: touching fixes only that direction; blank
at a full point), ``ax, ay, az`` (outward direction in the part from which the tool can come; blank:
along the normal, or from anywhere) and ``part`` (part or side the feature belongs to). A feature
that can be reached from two directions has two rows of the same name.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet import Sheet, column_key, finite_number, read_sheet

POINT: Final = ("px_mm", "py_mm", "pz_mm")
NORMAL: Final = ("nx", "ny", "nz")
ACCESS: Final = ("ax", "ay", "az")
COLUMNS: Final = ("name", *POINT, *NORMAL, *ACCESS, "part")
UNIT: Final = (0.5, 2.0)
"""Lengths a direction may have; outside it is a coordinate."""


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
    parts: tuple[str, ...] = ("part",)
    digest: str = ""

    def _check_rules(self) -> None:
        """Makes directions unit."""
        for name in ("normal", "access"):
            direction = getattr(self, name)
            self._set_column(name, direction / np.linalg.norm(direction, axis=1, keepdims=True))

    def __len__(self) -> int:
        return len(self.names)


def read_features(path: str | Path) -> Features:
    """Returns the features of a file.

    Raises:
        FormatError: A column is missing, unknown or incomplete, a cell is not a finite number, a
            direction is none; with its line.
    """
    sheet = read_sheet(path)
    keys = {column_key(name): i for i, name in enumerate(sheet.header)}
    _check_columns(sheet, keys)
    words = [_word(sheet, row, keys["part"]) for row in _rows(sheet)] if "part" in keys else []
    parts = tuple(dict.fromkeys(words)) or ("part",)
    point = [[finite_number(sheet, row, keys[name]) for name in POINT] for row in _rows(sheet)]
    return Features(
        names=tuple(_word(sheet, row, keys["name"]) for row in _rows(sheet)),
        point=np.array(point, dtype=np.float64).reshape(-1, 3) * MM,
        normal=_directions(sheet, keys, NORMAL),
        access=_directions(sheet, keys, ACCESS),
        part=np.array(
            [parts.index(word) for word in words] or [0] * len(sheet.cells), dtype=np.int64
        ),
        parts=parts,
        digest=sheet.digest,
    )


def _rows(sheet: Sheet) -> range:
    return range(len(sheet.cells))


def _check_columns(sheet: Sheet, keys: dict[str, int]) -> None:
    for name in sheet.header:
        if column_key(name) not in COLUMNS:
            near = difflib.get_close_matches(column_key(name), COLUMNS, n=1, cutoff=0.6)
            raise FormatError(
                f"unknown column {name!r}; allowed are {', '.join(COLUMNS)}.",
                source=sheet.source,
                line=sheet.header_line,
                hint=f"rename it to {near[0]!r}, or remove it." if near else "remove the column.",
            )
    for group, needed in ((("name", *POINT), True), (NORMAL, False), (ACCESS, False)):
        missing = [name for name in group if name not in keys]
        if missing and (needed or len(missing) < len(group)):
            raise FormatError(
                f"no column {', '.join(missing)}; the file has {', '.join(sheet.header)}.",
                source=sheet.source,
                line=sheet.header_line,
                hint="name,px_mm,py_mm,pz_mm and, where needed, nx,ny,nz,ax,ay,az,part.",
            )


def _word(sheet: Sheet, row: int, column: int) -> str:
    text = sheet.cells[row][column]
    if not text:
        raise FormatError(
            f"column {sheet.header[column]!r} is blank, expected a name.",
            source=sheet.source,
            line=sheet.lines[row],
        )
    return text


def _directions(sheet: Sheet, keys: dict[str, int], names: Sequence[str]) -> Array:
    """Directions (n, 3); NaN in a row that leaves all three blank."""
    out = np.full((len(sheet.cells), 3), np.nan)
    if names[0] not in keys:
        return out
    for row in _rows(sheet):
        if not any(sheet.cells[row][keys[name]] for name in names):
            continue
        found = np.array([finite_number(sheet, row, keys[name]) for name in names])
        length = float(np.linalg.norm(found))
        if not UNIT[0] <= length <= UNIT[1]:
            raise FormatError(
                f"{', '.join(names)} has length {length:g}, expected a direction of length "
                f"{UNIT[0]:g} to {UNIT[1]:g}.",
                source=sheet.source,
                line=sheet.lines[row],
                hint="a direction such as 0,0,1; not a point.",
            )
        out[row] = found
    return out
