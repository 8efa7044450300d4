"""Steps of a two-sided slot test, measured with a gauge: CSV, TSV or workbook.

Columns, in any order: ``slot`` (name) and ``step_mm`` (first side less second, signed, across the
slot). Rows of one slot are places along it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet import column_key, finite_number, read_sheet

COLUMNS: Final = ("slot", "step_mm")


def read_slot_steps(path: str | Path) -> tuple[tuple[str, ...], Array]:
    """Returns the names of the slots and their steps (k, n) m; NaN where a slot has fewer places.

    Raises:
        FormatError: A column is missing or unknown, a cell is blank or no finite number.
    """
    sheet = read_sheet(path)
    keys = {column_key(name): i for i, name in enumerate(sheet.header)}
    missing = [name for name in COLUMNS if name not in keys]
    strange = [name for name in keys if name not in COLUMNS]
    if missing or strange:
        raise FormatError(
            f"columns {', '.join(sheet.header)}; "
            + (f"missing: {', '.join(missing)}" if missing else f"unknown: {', '.join(strange)}")
            + ".",
            source=sheet.source,
            line=sheet.header_line,
            hint="slot,step_mm with one row for each place that was measured.",
        )
    steps: dict[str, list[float]] = {}
    for row, line in enumerate(sheet.lines):
        name = sheet.cells[row][keys["slot"]]
        if not name:
            raise FormatError("slot is blank, expected a name.", source=sheet.source, line=line)
        steps.setdefault(name, []).append(finite_number(sheet, row, keys["step_mm"]))
    if not steps:
        raise FormatError("no rows.", source=sheet.source, hint="one row for each place.")
    out = np.full((len(steps), max(len(v) for v in steps.values())), np.nan)
    for k, values in enumerate(steps.values()):
        out[k, : len(values)] = values
    return tuple(steps), out * MM
