"""Tables about cuts: mean forces of slots, depth and width along a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.dynamics.coefficients import CuttingTest
from robotrue.dynamics.cutter import CutterEngagement
from robotrue.dynamics.formats.column_table import ColumnTable, read_column_table
from robotrue.errors import FormatError

_SLOTS: Final = ("feed_per_tooth_mm", "fx_mean_N", "fy_mean_N", "fz_mean_N")
_ALONG: Final = ("path_mm", "depth_mm", "width_mm")


def read_slots(path: Path, cut: CutterEngagement) -> list[CuttingTest]:
    """Returns slotting tests with their mean forces.

    Args:
        path: One row per test.
        cut: What the table does not say: mode and spindle, depth and width where it has none.

    Raises:
        FormatError: A column that is missing or not known.
    """
    table = read_column_table(path)
    _require_columns(table, _SLOTS, ("depth_mm", "width_mm"))
    values = {name: table.column(name) for name in table.names}
    sizes = {"depth_mm": "depth", "width_mm": "width", "feed_per_tooth_mm": "feed_per_tooth"}
    stated = {field: values[name] * MM for name, field in sizes.items() if name in values}
    return [
        CuttingTest(
            cut=replace(cut, **{field: rows[k] for field, rows in stated.items()}),
            force=np.array([values[name][k] for name in _SLOTS[1:]]),
        )
        for k in range(len(table.values))
    ]


def read_along(path: Path) -> tuple[Array, Array, Array]:
    """Returns length along a path, depth and width there, (n,) m each.

    Raises:
        FormatError: A column that is missing or not known.
    """
    table = read_column_table(path)
    _require_columns(table, _ALONG)
    along, depth, width = (table.column(name) * MM for name in _ALONG)
    return along, depth, width


def _require_columns(
    table: ColumnTable, needed: Sequence[str], allowed: Sequence[str] = ()
) -> None:
    for name in needed:
        if name not in table.names:
            raise FormatError(
                f"no column {name}; expected {','.join(needed)}.",
                source=table.source,
                line=table.header_line,
            )
    for name in table.names:
        if name not in needed and name not in allowed:
            raise FormatError(
                f"column {name!r} is not known; expected {', '.join((*needed, *allowed))}.",
                source=table.source,
                line=table.header_line,
                hint="remove the column.",
            )
