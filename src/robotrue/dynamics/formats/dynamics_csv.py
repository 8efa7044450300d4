"""CSV files of dynamics: raw hammer tests, readings of a flange sensor, windows of milling passes.

A hammer test has ``t_s``, the hammer and the sensors. The hammer is ``fx_N``, ``fy_N`` or ``fz_N``,
after the axis it hits along. The sensors are ``ax_m_per_s2`` (accelerometer), ``vx_m_per_s``
(vibrometer) or ``x_um``, ``x_m`` (displacement) and their like for y and z, one kind per file; an
accelerometer may be in ``ax_g``.

A flange sensor at rest has one row per pose of the wrist: ``rx_deg, ry_deg, rz_deg`` (R_base_sensor
= Rz(rz) Ry(ry) Rx(rx)) and ``fx_N, fy_N, fz_N, mx_Nm, my_Nm, mz_Nm`` in the sensor frame, acting on
the sensor from the tool's side, each a mean at rest.

Windows have one row each::

    pass,j1_deg..j6_deg,fx_mean_N,fy_mean_N,fz_mean_N,f_peak_N,f_mean_N,predicted_um,measured_um

Forces act on the tool, in base axes. ``measured_um`` may be blank or missing where it was not
measured. ``start_s,end_s`` state the span of a window in the record of its pass; windows of a pass
that share time are refused. ``zero_taken`` is yes where the zero of the dynamometer was read before
and after the cut and subtracted, else no or blank.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.provenance import MEASURED, Provenance, mark_line
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, STANDARD_GRAVITY, UM
from robotrue.dynamics.formats.column_table import even_rate, read_column_table
from robotrue.dynamics.hits import HammerRecord
from robotrue.dynamics.windows import WindowSet, first_overlap
from robotrue.measurement.formats.sheet import Sheet, number_columns, write_columns
from robotrue.measurement.formats.sheet_file import read_sheet

_HAMMER: Final = re.compile(r"f([xyz])_N")
_SENSOR: Final = re.compile(r"(a|v|)([xyz])_(\w+)")
_UNITS: Final = {
    ("a", "m_per_s2"): ("accelerance", 1.0),
    ("a", "g"): ("accelerance", STANDARD_GRAVITY),
    ("v", "m_per_s"): ("mobility", 1.0),
    ("", "m"): ("receptance", 1.0),
    ("", "um"): ("receptance", UM),
}
ATTITUDE: Final = ("rx_deg", "ry_deg", "rz_deg")
WRENCH: Final = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
COLUMNS: Final = (*ATTITUDE, *WRENCH)
FORCES: Final = ("fx_mean_N", "fy_mean_N", "fz_mean_N", "f_peak_N", "f_mean_N")
ERRORS: Final = ("predicted_um", "measured_um")
SPAN: Final = ("start_s", "end_s")
ZERO_TAKEN: Final = "zero_taken"
_YES, _NO = "yes", "no"


def read_hammer_csv(path: str | Path) -> HammerRecord:
    """Returns the record of a file.

    Raises:
        FormatError: No hammer or more than one, no sensor, a column that is not known or without
            its unit, a cell that is no finite number; with its line.
        ImplausibleDataError: An uneven clock.
    """
    table = read_column_table(path)
    hammers = [name for name in table.names if _HAMMER.fullmatch(name)]
    if len(hammers) != 1:
        raise table.fault(
            f"{len(hammers)} hammer columns, expected one of fx_N, fy_N, fz_N.",
            "one file per axis of the hammer.",
        )
    sensors: dict[str, str] = {}
    forms: set[tuple[str, float]] = set()
    for name in table.names:
        if name in ("t_s", hammers[0]):
            continue
        named = _SENSOR.fullmatch(name)
        if named is None or (named[1], named[3]) not in _UNITS:
            raise table.fault(
                f"column {name!r} is not known or has no unit; sensors are called ax_m_per_s2, "
                "ax_g, vx_m_per_s, x_m or x_um.",
                "rename or remove it.",
            )
        forms.add(_UNITS[named[1], named[3]])
        sensors[named[2]] = name
    if "t_s" not in table.names or not sensors:
        raise table.fault("no column t_s, or no sensor.", "t_s,fx_N,ax_m_per_s2,ay_m_per_s2")
    if len(forms) > 1:
        raise table.fault(f"sensors of {len(forms)} kinds or units.", "one kind per file.")
    form, scale = forms.pop()
    _, rate = even_rate(table.column("t_s"), path, table.line)
    axes = tuple(sorted(sensors))
    return HammerRecord(
        rate=rate,
        force=table.column(hammers[0]),
        excitation_axis=hammers[0][1],
        motion=scale * table.stack([sensors[axis] for axis in axes]),
        response_axes=axes,
        form=form,
        source=str(path),
        provenance=table.provenance,
    )


def read_sensor_csv(path: str | Path) -> tuple[Array, Array]:
    """Returns R_base_sensor (n, 3, 3) and readings (n, 6) N, N m of a file.

    Raises:
        FormatError: A column that is missing or not known, a cell that is no finite number; with
            its line.
    """
    table = read_column_table(path)
    table.require(COLUMNS, hint="angles in deg, forces in N, moments in N m.")
    return matrix_from_abc(table.stack(ATTITUDE[::-1]) * DEG), table.stack(WRENCH)


def sensor_csv(R_base_sensor: Array, readings: Array, provenance: Provenance = MEASURED) -> bytes:
    """Returns the file of rotations (n, 3, 3) and readings (n, 6) N, N m, with its mark."""
    angles = abc_from_matrix(R_base_sensor)[:, ::-1] / DEG
    rows = np.concatenate([angles, readings], axis=1)
    lines = [mark_line(provenance) + ",".join(COLUMNS)]
    lines += [",".join(f"{v:.6f}" for v in row) for row in rows.tolist()]
    return ("\n".join(lines) + "\n").encode()


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
    """Returns (n,), true where the zero was subtracted already."""
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
