"""robotrue's own CSV: the columns, reading their names, and writing them.

``j1_deg .. jn_deg, x_mm, y_mm, z_mm`` and, each group whole or absent, ``rx_deg, ry_deg, rz_deg``
(R = Rz(rz) Ry(ry) Rx(rx)), ``sx_mm, sy_mm, sz_mm`` (one sigma), ``cxy_mm2, cxz_mm2, cyz_mm2``
(covariances), ``fx_N, fy_N, fz_N``, ``mx_Nm, my_Nm, mz_Nm``, ``approach1 .. approachn``,
``temperature_C``, ``payload_kg``, ``payload_x_mm, payload_y_mm, payload_z_mm``, ``target``,
``station``, ``set``. Any order, any case. A column with another name is an error: a misspelt
``fx_N`` passed over would be a wrong result.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.core.provenance import mark_line
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.measurement_set import MeasurementSet

POSITION: Final = ("x_mm", "y_mm", "z_mm")
_JOINT: Final = re.compile(r"j(\d+)_deg")
_OPTIONAL: Final = (
    "rotation",
    "position_std",
    "position_correlation",
    "force",
    "moment",
    "approach",
    "temperature",
    "payload_mass",
    "payload_com",
    "target",
    "station",
    "set_name",
)


def canonical_mapping(dof: int = 6, *, positions: bool = True) -> ColumnMapping:
    """Returns the mapping of the canonical columns for an arm of ``dof`` joints.

    Args:
        dof: Number of joints.
        positions: False where ``x_mm, y_mm, z_mm`` need not be there (queries).
    """
    return ColumnMapping(
        name="canonical",
        joints=tuple(f"j{i + 1}_deg" for i in range(dof)),
        position=POSITION,
        rotation=("rx_deg", "ry_deg", "rz_deg"),
        position_std=("sx_mm", "sy_mm", "sz_mm"),
        position_correlation=("cxy_mm2", "cxz_mm2", "cyz_mm2"),
        force=("fx_N", "fy_N", "fz_N"),
        moment=("mx_Nm", "my_Nm", "mz_Nm"),
        approach=tuple(f"approach{i + 1}" for i in range(dof)),
        temperature=("temperature_C",),
        payload_mass=("payload_kg",),
        payload_com=("payload_x_mm", "payload_y_mm", "payload_z_mm"),
        target=("target",),
        station=("station",),
        set_name=("set",),
        optional=_OPTIONAL if positions else (*_OPTIONAL, "position"),
        ignore_other=False,
    )


def canonical_joints(header: Sequence[str]) -> int:
    """Returns how many joint columns (``j1_deg``, ``j2_deg``, ...) a header has."""
    return sum(1 for name in header if _JOINT.fullmatch(column_key(name)))


def unknown_column(name: str, known: Sequence[str], sheet: Sheet) -> FormatError:
    """Returns the error for a column nobody asked for, with the nearest known name."""
    keys = {column_key(k): k for k in known}
    near = difflib.get_close_matches(column_key(name), keys, n=1, cutoff=0.6)
    return FormatError(
        f"unknown column {name!r}; allowed are {', '.join(known)}.",
        source=sheet.source,
        line=sheet.header_line,
        hint=f"rename it to {keys[near[0]]!r}, or remove it." if near else "remove the column.",
    )


def write_canonical(path: str | Path, measurements: MeasurementSet) -> None:
    """Writes a measurement set as canonical CSV, whole or not at all.

    Every number is printed with all its digits. The frame of the positions and the covariance of
    the orientation have no column; whoever reads the file states the frame. Simulated measurements
    are marked by a comment line above the columns.

    Raises:
        FormatError: The file cannot be written, or orientation was measured on some rows only.
    """
    columns = _columns(measurements)
    rows = zip(*columns.values(), strict=True)
    head = mark_line(measurements.provenance)
    write_atomic(path, (head + csv_text(chain([columns], rows))).encode())


def _columns(m: MeasurementSet) -> dict[str, list[str]]:
    names = canonical_mapping(m.dof)
    out = _block(names.joints, m.joints / DEG) | _block(names.position, m.position / MM)
    for what, values in (("orientation", m.rotation), ("payload", m.payload_mass[:, None])):
        known = np.isfinite(values).reshape(len(m), -1).all(axis=1)
        if known.any() and not known.all():
            raise FormatError(
                f"{what} is known for {int(known.sum())} of {len(m)} rows; a column has no blanks.",
                hint="write the rows with and without it to two files.",
            )
    if m.has_rotation.any():
        out |= _block(names.rotation, abc_from_matrix(m.rotation)[:, ::-1] / DEG)
    covariance = m.covariance / MM**2
    out |= _block(names.position_std, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))
    shared = covariance[:, [0, 0, 1], [1, 2, 2]]
    if shared.any():
        out |= _block(names.position_correlation, shared)
    if m.wrench.any():
        out |= _block(names.force, m.wrench[:, :3]) | _block(names.moment, m.wrench[:, 3:])
    if m.approach.any():
        out |= _block(names.approach, m.approach)
    if np.isfinite(m.temperature).all():
        out |= _block(names.temperature, m.temperature[:, None] - 273.15)
    if np.isfinite(m.payload_mass).all():
        out |= _block(names.payload_mass, m.payload_mass[:, None])
    if np.isfinite(m.payload_com).all():
        out |= _block(names.payload_com, m.payload_com / MM)
    for name, numbers in (("target", m.target), ("station", m.station)):
        if numbers.any():
            out[name] = [str(int(i)) for i in numbers]
    out["set"] = [m.group_names[int(i)] for i in m.group]
    return out


def _block(names: Sequence[str], values: Array) -> dict[str, list[str]]:
    return {name: [repr(float(v)) for v in values[:, i]] for i, name in enumerate(names)}
