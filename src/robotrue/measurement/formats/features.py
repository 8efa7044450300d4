"""Features of a part that could be touched, as CSV, TSV or workbook.

Columns, in any order: ``name``, ``px_mm, py_mm, pz_mm`` (nominal point in the part), optionally
``nx, ny, nz`` (outward normal in the part, of a surface: touching fixes only that direction; blank
at a full point), ``ax, ay, az`` (outward direction in the part from which the tool can come; blank:
along the normal, or from anywhere) and ``part`` (part or side the feature belongs to). A feature
that can be reached from two directions has two rows of the same name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.measurement.formats.part_columns import (
    NORMAL,
    POINT,
    PartSheet,
    read_part_sheet,
)

ACCESS: Final = ("ax", "ay", "az")
EXAMPLE: Final = "name,px_mm,py_mm,pz_mm and, where needed, nx,ny,nz,ax,ay,az,part."


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
    columns = read_part_sheet(path, names_rows=False)
    columns.require((("name", *POINT),), (NORMAL, ACCESS, ("part",)), EXAMPLE)
    parts, part = columns.parts()
    point = columns.numbers(POINT) * MM
    return Features(
        names=columns.words("name"),
        point=point,
        normal=_directions(columns, NORMAL),
        access=_directions(columns, ACCESS),
        part=part,
        parts=parts,
        digest=columns.sheet.digest,
    )


def _directions(columns: PartSheet, names: Sequence[str]) -> Array:
    return columns.directions(
        names,
        ", ".join(names),
        "a direction such as 0,0,1; not a point.",
        zero_is_blank=False,
    )
