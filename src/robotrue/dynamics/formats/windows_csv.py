"""Windows of milling passes as CSV, one row each.

    pass,j1_deg..j6_deg,fx_mean_N,fy_mean_N,fz_mean_N,f_peak_N,f_mean_N,predicted_um,measured_um

Forces act on the tool, in base axes. ``measured_um`` may be blank or missing where nobody measured.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.units import DEG, UM
from robotrue.dynamics.windows import WindowSet
from robotrue.measurement.formats.sheet import number_columns, write_columns
from robotrue.measurement.formats.sheet_file import read_sheet

FORCES: Final = ("fx_mean_N", "fy_mean_N", "fz_mean_N", "f_peak_N", "f_mean_N")
ERRORS: Final = ("predicted_um", "measured_um")


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
        source=str(path),
        provenance=sheet.provenance,
    )


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
    write_columns(path, {"pass": windows.passes, **numbers}, windows.provenance)
