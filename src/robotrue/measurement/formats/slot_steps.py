"""Steps of a two-sided slot test, measured with a gauge: CSV, TSV or workbook.

Columns, in any order: ``slot`` (name) and ``step_mm`` (first side less second, signed, across the
slot). Rows of one slot are places along it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.measurement.formats.sheet_file import read_sheet


def read_slot_steps(path: str | Path) -> tuple[tuple[str, ...], Array]:
    """Returns the names of the slots and their steps (k, n) m; NaN where a slot has fewer places.

    Raises:
        FormatError: A column is missing or unknown, a cell is blank or no finite number.
    """
    sheet = read_sheet(path)
    example = "slot,step_mm with one row for each place that was measured."
    sheet.check_columns((("slot", "step_mm"),), (), example)
    words, values = sheet.words("slot"), sheet.numbers(("step_mm",))[:, 0] * MM
    slots = tuple(dict.fromkeys(words))
    rows = [values[[word == slot for word in words]] for slot in slots]
    steps = np.full((len(slots), max(map(len, rows))), np.nan)
    for k, row in enumerate(rows):
        steps[k, : len(row)] = row
    return slots, steps
