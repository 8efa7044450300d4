"""Windows of milling passes as CSV, one row each.

    pass,j1_deg..j6_deg,fx_mean_N,fy_mean_N,fz_mean_N,f_peak_N,f_mean_N,predicted_um,measured_um

Forces act on the tool, in base axes. ``measured_um`` may be blank or missing where nobody measured.
``start_s,end_s`` beside them say where in the record of its pass a window lies; windows of a pass
that share time are refused. ``zero_taken`` is yes where the zero of the dynamometer was read before
and behind the cut and taken off, no or blank where nobody did.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.units import DEG, UM
from robotrue.dynamics.windows import WindowSet, first_overlap
from robotrue.measurement.formats.sheet import Sheet, number_columns, write_columns
from robotrue.measurement.formats.sheet_file import read_sheet

FORCES: Final = ("fx_mean_N", "fy_mean_N", "fz_mean_N", "f_peak_N", "f_mean_N")
ERRORS: Final = ("predicted_um", "measured_um")
SPAN: Final = ("start_s", "end_s")
ZERO_TAKEN: Final = "zero_taken"
_YES, _NO = "yes", "no"


def read_windows(path: str | Path) -> WindowSet:
    """Returns the windows of a CSV file; comma, semicolon or tab, ``#`` lines are remarks.

    Raises:
        FormatError: No header, a column missing, a cell that is no finite number; with its line.
    """
    sheet = read_sheet(path)
    count = sum(name.startswith("j") and name.endswith("_deg") for name in sheet.header)
    joints = [f"j{i + 1}_deg" for i in range(max(count, 6))]
    wanted = ["pass", *joints, *FORCES, ERRORS[0]]
    missing = [name for name in wanted if not sheet.has(name)]
    if missing:
        raise sheet.lacking_columns(
            missing[:1], f"the columns are {','.join((*wanted, ERRORS[1]))}."
        )
    passes = sheet.column("pass")
    if not all(passes):
        raise sheet.fault("a window without a pass.", "name its pass.", row=passes.index(""))
    forces = sheet.numbers(FORCES)
    measured = np.full(len(sheet), np.nan)
    if sheet.has(ERRORS[1]):
        known = [row for row, cell in enumerate(sheet.column(ERRORS[1])) if cell]
        measured[known] = sheet.take(known).numbers(ERRORS[1:])[:, 0] * UM
    return WindowSet(
        passes=passes,
        joints=sheet.numbers(joints) * DEG,
        force=forces[:, :3],
        force_peak=forces[:, 3],
        force_mean=forces[:, 4],
        predicted=sheet.numbers(ERRORS[:1])[:, 0] * UM,
        measured=measured,
        span=_read_span(sheet),
        zero_taken=_read_zero_taken(sheet),
        source=str(path),
        provenance=sheet.provenance,
    )


def read_edges(path: str | Path) -> Array:
    """Returns start and end (k, 2) s of windows that the user states.

    Raises:
        FormatError: A column missing, no number, windows that end before they start or overlap;
            with its line.
    """
    sheet = read_sheet(path)
    missing = [name for name in SPAN if not sheet.has(name)]
    if missing:
        raise sheet.lacking_columns(missing, f"the columns are {','.join(SPAN)}.")
    return _checked_span(sheet, range(len(sheet)))


def _read_span(sheet: Sheet) -> Array:
    """Start and end (n, 2) s of windows; NaN where the file does not state them."""
    out = np.full((len(sheet), 2), np.nan)
    if not all(sheet.has(name) for name in SPAN):
        return out
    passes = sheet.column("pass")
    for name in dict.fromkeys(passes):
        rows = [k for k, own in enumerate(passes) if own == name and sheet.column(SPAN[0])[k]]
        if rows:
            out[rows] = _checked_span(sheet, rows)
    return out


def _read_zero_taken(sheet: Sheet) -> BoolArray:
    """Whether the zero was taken off (n,)."""
    if not sheet.has(ZERO_TAKEN):
        return np.zeros(len(sheet), dtype=bool)
    cells = [cell.lower() for cell in sheet.column(ZERO_TAKEN)]
    for row, cell in enumerate(cells):
        if cell not in (_YES, _NO, ""):
            raise sheet.fault(
                f"{ZERO_TAKEN} is {cell!r}, expected {_YES} or {_NO}.",
                "yes only where the zero was read in the air before and behind the cut.",
                row=row,
            )
    return np.array([cell == _YES for cell in cells], dtype=bool)


def _checked_span(sheet: Sheet, rows: Sequence[int]) -> Array:
    """Start and end (k, 2) s in rows of a sheet, none overlapping."""
    span = sheet.take(rows).numbers(SPAN)
    odd = np.flatnonzero(span[:, 1] <= span[:, 0])
    if odd.size:
        k = int(odd[0])
        raise sheet.fault(
            f"a window from {span[k, 0]:.3f} to {span[k, 1]:.3f} s.",
            "windows end after they start.",
            row=rows[k],
        )
    shared = first_overlap(span)
    if shared is not None:
        one, two = shared
        raise sheet.fault(
            f"a window from {span[two, 0]:.3f} s, before the end of another at {span[one, 1]:.3f} "
            "s: windows that overlap.",
            "one sample belongs to one window: held out and learned from, it would flatter.",
            row=rows[two],
        )
    return span


def write_windows(path: str | Path, windows: WindowSet) -> None:
    """Writes windows with all their digits, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    joints = [f"j{i + 1}_deg" for i in range(windows.joints.shape[1])]
    values = np.column_stack(
        [
            windows.joints / DEG, windows.force, windows.force_peak, windows.force_mean,
            windows.predicted / UM, windows.measured / UM,
        ]
    )  # fmt: skip
    numbers = number_columns([*joints, *FORCES, *ERRORS], values)
    if np.isfinite(windows.span).any():
        numbers |= number_columns(SPAN, windows.span)
    if windows.zero_taken.any():
        numbers[ZERO_TAKEN] = [_YES if taken else _NO for taken in windows.zero_taken.tolist()]
    write_columns(path, {"pass": windows.passes, **numbers}, windows.provenance)
