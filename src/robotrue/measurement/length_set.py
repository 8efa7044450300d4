"""Lengths that a draw wire, a ball bar or a gauge bar shows of an arm: one noun for all.

As CSV: ``j1_deg`` ..., ``length_mm``, and what is at the other end: ``anchor`` (a name) with
``ax_mm, ay_mm, az_mm``, roughly where it is in base; or, with ``anchor`` blank, ``k1_deg`` ...: the
other pose of a gauge bar. ``sigma_mm`` is one standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, count_rows
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.measurement.formats.canonical import joint_names, joints_in
from robotrue.measurement.formats.sheet import Sheet
from robotrue.measurement.formats.sheet_file import read_sheet

NO_ANCHOR = -1
"""Anchor of a length between two poses of the arm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthSet(Columns):
    """n lengths, each from the reflector to an anchor, or to the reflector in another pose.

    A draw wire has its eyelet for an anchor, a ball bar its fixed socket. A gauge bar with two
    sockets for the tool has no anchor: it lies between two poses.

    Attributes:
        joints: (n, dof) rad, in the robot model's sense.
        length: (n,) m.
        sigma: (n,) m, one standard deviation of ``length``.
        anchor: (n,) number of the anchor, or ``NO_ANCHOR``.
        second: (n, dof) rad, the other pose of a length without anchor; NaN with one.
        anchors: (k, 3) m in base, roughly where the anchors are: within some centimetres.
        anchor_names: (k) what they are called.
        source: File the lengths came from.
        lines: (n,) one-based line in it.
        provenance: Simulated or measured, instrument and file.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    length: Annotated[Array, Column("n", unit="m")]
    sigma: Annotated[Array, Column("n", unit="m")]
    anchor: Annotated[IntArray, Column("n", fill=0)] = EMPTY
    second: Annotated[Array, Column("n dof", unit="rad", nan=True, fill=np.nan)] = EMPTY
    anchors: Annotated[Array, Column("k 3", unit="m")]
    anchor_names: Annotated[tuple[str, ...], Column("k")]
    source: str = ""
    lines: Annotated[IntArray, Column("n", fill=count_rows)] = EMPTY
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Checks that every length ends at an existing anchor, or at another pose.

        Raises:
            ShapeError: It does not, or a length or its sigma is zero or less.
        """
        if (self.length <= 0.0).any() or (self.sigma <= 0.0).any():
            raise ShapeError("a length or its sigma is zero or less, expected above 0.")
        known = (self.anchor >= NO_ANCHOR) & (self.anchor < len(self.anchors))
        if not known.all():
            raise ShapeError(f"{len(self.anchors)} anchors, numbered from 0; a row has another.")
        if not np.array_equal(self.between_poses, np.isfinite(self.second).all(axis=1)):
            raise ShapeError("a length has an anchor or a second pose, not both, and not neither.")

    def __len__(self) -> int:
        return len(self.length)

    @property
    def between_poses(self) -> BoolArray:
        """(n,) True where a length lies between two poses."""
        return np.asarray(self.anchor == NO_ANCHOR)


SIGMA: Final = 0.05 * MM
"""m, of a draw wire, where the file states none."""
_PLACE: Final = ("ax_mm", "ay_mm", "az_mm")
_SAME: Final = 1e-6


def read_lengths(path: str | Path) -> LengthSet:
    """Returns the lengths of a CSV, TSV, TXT or workbook file.

    Raises:
        FormatError: A column is missing or unknown, a cell is no number, a length is zero or less,
            or an anchor has two positions.
    """
    sheet = read_sheet(path)
    dof = joints_in(sheet.header) or 6
    second = tuple(f"k{i + 1}_deg" for i in range(dof))
    sheet.check_columns(
        [joint_names(dof), ("length_mm",)],
        [("sigma_mm",), ("anchor",), _PLACE, second],
        "columns of lengths are j1_deg ..., length_mm, sigma_mm, anchor with ax_mm, ay_mm, az_mm, "
        "or k1_deg ... of the other pose.",
    )
    n = len(sheet)
    cells = sheet.column("anchor") if sheet.has("anchor") else ("anchor",) * n
    if not sheet.has(_PLACE[0]):
        cells = ("",) * n
    names = tuple(dict.fromkeys(cell for cell in cells if cell))
    number = np.array([names.index(cell) if cell else NO_ANCHOR for cell in cells])
    return LengthSet(
        joints=sheet.numbers(joint_names(dof)) * DEG,
        length=_positive(sheet, "length_mm") * MM,
        sigma=_positive(sheet, "sigma_mm") * MM if sheet.has("sigma_mm") else np.full(n, SIGMA),
        anchor=number,
        second=_second_poses(sheet, second, number == NO_ANCHOR),
        anchors=_places(sheet, number, len(names)),
        anchor_names=names,
        source=sheet.source,
        lines=np.array(sheet.lines),
        provenance=sheet.provenance,
    )


def _positive(sheet: Sheet, name: str) -> Array:
    values = sheet.numbers([name])[:, 0]
    for row in np.flatnonzero(values <= 0.0).tolist():
        message = f"column {name!r} is {values[row]:g}, expected above 0."
        raise sheet.fault(message, "correct or delete that row.", row=row)
    return values


def _second_poses(sheet: Sheet, names: tuple[str, ...], wanted: Array) -> Array:
    poses = np.full((len(sheet), len(names)), np.nan)
    rows = np.flatnonzero(wanted)
    if rows.size:
        poses[rows] = sheet.take(rows.tolist()).numbers(names) * DEG
    return poses


def _places(sheet: Sheet, number: Array, count: int) -> Array:
    """Returns the places of the anchors, (k, 3) m."""
    places = np.zeros((count, 3))
    for k in range(count):
        rows = np.flatnonzero(number == k).tolist()
        values = sheet.take(rows).numbers(_PLACE) * MM
        for row, value in zip(rows, values, strict=True):
            if np.abs(value - values[0]).max() > _SAME:
                message = f"an anchor at another place than on line {sheet.lines[rows[0]]}."
                raise sheet.fault(message, "give it another name.", row=row)
        places[k] = values[0]
    return places
