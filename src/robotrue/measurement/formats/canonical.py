"""robotrue's own CSV: the columns, reading their names, and writing them.

``j1_deg .. jn_deg`` (joints of the robot model) or ``a1_deg .. an_deg`` (axes as the controller
displays them; next to ``j1_deg`` they are for human readers only and ignored), ``x_mm, y_mm, z_mm``
and, each group whole or absent, ``rx_deg, ry_deg, rz_deg`` (R = Rz(rz) Ry(ry) Rx(rx)), ``sx_mm,
sy_mm, sz_mm`` (one sigma), ``cxy_mm2, cxz_mm2, cyz_mm2`` (covariances), ``fx_N, fy_N, fz_N``,
``mx_Nm, my_Nm, mz_Nm``, ``approach1 .. approachn``, ``temperature_C``, ``temperature1_C ..
temperaturen_C`` (of each joint), ``time_s`` or ``timestamp`` (ISO 8601), ``e1_mm`` or ``e1_deg`` to
``e6_mm`` or ``e6_deg`` (external axes, each by itself), ``payload_kg``, ``payload_x_mm,
payload_y_mm, payload_z_mm``, ``target``, ``station``, ``set``, ``monument`` (name of a nest on the
floor, re-shot during the run; such a row needs no joints). Any order, any case. A column with
another name is an error: ignoring a misspelt ``fx_N`` would give a wrong result.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM, ZERO_CELSIUS
from robotrue.errors import FormatError
from robotrue.measurement.formats.mapping import GROUPS, ColumnMapping
from robotrue.measurement.formats.sheet import column_key, number_columns, write_columns
from robotrue.measurement.measurement_set import MeasurementSet

POSITION: Final = ("x_mm", "y_mm", "z_mm")
_JOINT: Final = re.compile(r"j(\d+)_deg")
_AXIS: Final = re.compile(r"a(\d+)_deg")


def canonical_mapping(dof: int) -> ColumnMapping:
    """Returns the mapping of the canonical columns for an arm of ``dof`` joints."""
    return ColumnMapping(
        name="canonical",
        joints=joint_names(dof),
        position=POSITION,
        rotation=("rx_deg", "ry_deg", "rz_deg"),
        position_std=("sx_mm", "sy_mm", "sz_mm"),
        position_correlation=("cxy_mm2", "cxz_mm2", "cyz_mm2"),
        force=("fx_N", "fy_N", "fz_N"),
        moment=("mx_Nm", "my_Nm", "mz_Nm"),
        approach=tuple(f"approach{i + 1}" for i in range(dof)),
        temperature=("temperature_C",),
        joint_temperature=tuple(f"temperature{i + 1}_C" for i in range(dof)),
        time=("time_s",),
        timestamp=("timestamp",),
        payload_mass=("payload_kg",),
        payload_com=("payload_x_mm", "payload_y_mm", "payload_z_mm"),
        target=("target",),
        station=("station",),
        set_name=("set",),
        point_name=("monument",),
        monuments=("?*",),
        optional=tuple(group for group in GROUPS if group not in ("joints", "position")),
        ignore_other=False,
    )


def external_names(header: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of the columns of E1 and on in a header, empty where it has none."""
    present = {column_key(name) for name in header}
    found = [
        next((name for name in (f"e{i}_mm", f"e{i}_deg") if name in present), "")
        for i in range(1, EXTERNAL_AXES + 1)
    ]
    last = max((i for i, name in enumerate(found, start=1) if name), default=0)
    return tuple(found[:last])


def joint_names(dof: int) -> tuple[str, ...]:
    """Returns the names of the joint columns: ``j1_deg``, ``j2_deg``, ..."""
    return tuple(f"j{i + 1}_deg" for i in range(dof))


def joints_in(header: Sequence[str]) -> int:
    """Returns how many joint columns a header has."""
    return sum(1 for name in header if _JOINT.fullmatch(column_key(name)))


def axes_in(header: Sequence[str]) -> int:
    """Returns how many columns of axes, as the controller displays them, a header has."""
    return sum(1 for name in header if _AXIS.fullmatch(column_key(name)))


def write_canonical(path: str | Path, measurements: MeasurementSet) -> None:
    """Writes a measurement set as canonical CSV, whole or not at all.

    Every number is printed with all its digits. The frame of the positions and the covariance of
    the orientation have no column; the reader of the file states the frame. Simulated measurements
    are marked by a comment line above the columns.

    Raises:
        FormatError: The file cannot be written, or orientation was measured on some rows only.
    """
    write_columns(path, canonical_columns(measurements), measurements.provenance)


def canonical_columns(m: MeasurementSet) -> dict[str, list[str]]:
    """Returns the canonical columns of a set by name, every number with all its digits.

    Of external axes the rail has a column; positions in base are in the base where it is ``at``.

    Raises:
        FormatError: Orientation or payload is known for some rows only.
    """
    names = canonical_mapping(m.dof)
    out = number_columns(names.joints, m.joints / DEG) | number_columns(
        names.position, m.floor_position / MM
    )
    for what, values in (("orientation", m.rotation), ("payload", m.payload_mass[:, None])):
        known = np.isfinite(values).reshape(len(m), -1).all(axis=1)
        if known.any() and not known.all():
            raise FormatError(
                f"{what} is known for {int(known.sum())} of {len(m)} rows; a column has no blanks.",
                hint="write the rows with and without it to two files.",
            )
    if m.has_rotation.any():
        out |= number_columns(names.rotation, abc_from_matrix(m.rotation)[:, ::-1] / DEG)
    covariance = m.covariance / MM**2
    out |= number_columns(names.position_std, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))
    shared = covariance[:, [0, 0, 1], [1, 2, 2]]
    if shared.any():
        out |= number_columns(names.position_correlation, shared)
    if m.wrench.any():
        out |= number_columns(names.force, m.wrench[:, :3]) | number_columns(
            names.moment, m.wrench[:, 3:]
        )
    if m.approach.any():
        out |= number_columns(names.approach, m.approach)
    if np.isfinite(m.temperature).all():
        out |= number_columns(names.temperature, m.temperature[:, None] - ZERO_CELSIUS)
    if np.isfinite(m.joint_temperature).all():
        out |= number_columns(names.joint_temperature, m.joint_temperature - ZERO_CELSIUS)
    if np.isfinite(m.time).all():
        out |= number_columns(names.time, m.time[:, None])
    if m.rail is not None:
        place = m.external[:, [m.rail.number - 1]]
        out |= number_columns([f"e{m.rail.number}_mm"], place / MM)
    if np.isfinite(m.payload_mass).all():
        out |= number_columns(names.payload_mass, m.payload_mass[:, None])
    if np.isfinite(m.payload_com).all():
        out |= number_columns(names.payload_com, m.payload_com / MM)
    for name, numbers in (("target", m.target), ("station", m.station)):
        if numbers.any():
            out[name] = [str(int(i)) for i in numbers]
    out["set"] = [m.group_names[int(i)] for i in m.group]
    return out
