"""Lengths as CSV: ``j1_deg`` ..., ``length_mm``, and what is at the other end.

``anchor`` (a name) with ``ax_mm, ay_mm, az_mm``, roughly where it is in base; or, with ``anchor``
blank, ``k1_deg`` ...: the other pose of a gauge bar. ``sigma_mm`` is one standard deviation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.measurement.formats.canonical import joint_names, joints_in
from robotrue.measurement.formats.sheet import Sheet
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.length_set import NO_ANCHOR, LengthSet

SIGMA: Final = 0.05 * MM
"""m, of a draw wire, where the file states none."""
_PLACE: Final = ("ax_mm", "ay_mm", "az_mm")
_SAME: Final = 1e-6


def read_lengths(path: str | Path) -> LengthSet:
    """Returns the lengths of a CSV, TSV, TXT or workbook file.

    Raises:
        FormatError: A column is missing or unknown, a cell is no number, a length is zero or less,
            or an anchor stands in two places.
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
    """Where the anchors are, (k, 3) m."""
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
