"""Windows of milling passes as CSV, one row each.

    pass,j1_deg..j6_deg,fx_mean_N,fy_mean_N,fz_mean_N,f_peak_N,f_mean_N,predicted_um,measured_um

Forces act on the tool, in base axes. ``measured_um`` may be blank or missing where nobody measured.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.csv_text import as_written, csv_text
from robotrue.core.files import read_bytes
from robotrue.core.provenance import mark_line, read_provenance
from robotrue.core.units import DEG, UM
from robotrue.core.utf8 import utf8_text
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import FormatError

FORCES: Final = ("fx_mean_N", "fy_mean_N", "fz_mean_N", "f_peak_N", "f_mean_N")
ERRORS: Final = ("predicted_um", "measured_um")


def read_windows(path: str | Path) -> WindowSet:
    """Returns the windows of a CSV file; comma, semicolon or tab, ``#`` lines are remarks.

    Raises:
        FormatError: No header, a column missing, a cell that is no finite number; with its line.
    """
    text = utf8_text(read_bytes(path), path)
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.startswith("#")
    ]
    if len(lines) < 2:
        raise FormatError("no header with windows below it.", source=path)
    head = lines[0][1]
    mark = max(",;\t", key=head.count)
    try:
        table = list(csv.reader((line for _, line in lines), delimiter=mark))
    except csv.Error as cause:
        raise FormatError(
            f"cannot be split into cells ({cause}).",
            source=path,
            hint="look for a stray quotation mark.",
        ) from None
    names = [name.strip() for name in table[0]]
    joints = [name for name in names if name.startswith("j") and name.endswith("_deg")]
    wanted = ["pass", *(f"j{i + 1}_deg" for i in range(max(len(joints), 6))), *FORCES]
    missing = [name for name in (*wanted, ERRORS[0]) if name not in names]
    if missing:
        raise FormatError(
            f"no column {missing[0]!r}; there are {', '.join(names)}.",
            source=path,
            line=lines[0][0],
            hint=f"the columns are {','.join((*wanted, *ERRORS))}.",
        )
    if len(set(names)) != len(names):
        raise FormatError("a column stands twice.", source=path, line=lines[0][0])
    at = {name: names.index(name) for name in (*wanted, *ERRORS) if name in names}
    passes, rows = [], []
    for (number, _), row in zip(lines[1:], table[1:], strict=True):
        if len(row) != len(names):
            raise FormatError(
                f"{len(row)} cells, the header has {len(names)}.", source=path, line=number
            )
        passes.append(as_written(row[at["pass"]].strip()))
        if not passes[-1]:
            raise FormatError(
                "a window without a pass.",
                source=path,
                line=number,
                hint="name its pass.",
            )
        rows.append(
            [
                _number(row[at[name]] if name in at else "", name, path, number)
                for name in (*wanted[1:], *ERRORS)
            ]
        )
    values, n = np.array(rows), len(wanted) - 1 - len(FORCES)
    return WindowSet(
        passes=tuple(passes),
        joints=values[:, :n] * DEG,
        force=values[:, n : n + 3],
        force_peak=values[:, n + 3],
        force_mean=values[:, n + 4],
        predicted=values[:, n + 5] * UM,
        measured=values[:, n + 6] * UM,
        source=str(path),
        provenance=read_provenance(path),
    )


def windows_bytes(windows: WindowSet) -> bytes:
    """Returns the CSV of windows, enough digits to read the same numbers again."""
    joints = [f"j{i + 1}_deg" for i in range(windows.joints.shape[1])]
    rows = [["pass", *joints, *FORCES, *ERRORS]]
    for k, name in enumerate(windows.passes):
        numbers = [
            *(windows.joints[k] / DEG),
            *windows.force[k],
            windows.force_peak[k],
            windows.force_mean[k],
            windows.predicted[k] / UM,
            windows.measured[k] / UM,
        ]
        rows.append([name, *("" if math.isnan(v) else f"{v:.12g}" for v in numbers)])
    return (mark_line(windows.provenance) + csv_text(rows)).encode()


def _number(cell: str, name: str, path: str | Path, line: int) -> float:
    cell = cell.strip()
    if not cell and name == ERRORS[1]:
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FormatError(
            f"{name} is {cell!r}, expected a finite number.",
            source=path,
            line=line,
            hint="leave the window out, or mark a sensor that failed.",
        )
    return value
