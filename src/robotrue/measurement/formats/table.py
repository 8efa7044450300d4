"""From named columns of text to a MeasurementSet: the one reader behind every instrument."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.measurement.formats.mapped_sheet import MappedSheet
from robotrue.measurement.formats.mapping import ANGLE, LENGTH, ColumnMapping
from robotrue.measurement.formats.rotation_columns import rotation_columns
from robotrue.measurement.formats.sheet import Sheet
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.tracker import Instrument, default_instrument

AxisRelation: TypeAlias = Callable[[Array], Array]
"""The controller's axes (n, dof) rad to joints of the robot model (n, dof) rad."""
_ZERO_CELSIUS = 273.15


def read_table(
    sheet: Sheet,
    mapping: ColumnMapping,
    *,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
    relation: AxisRelation | None = None,
) -> MeasurementSet:
    """Returns the measurements of a sheet.

    Args:
        sheet: From :func:`robotrue.measurement.formats.sheet.read_sheet`.
        mapping: What the columns hold.
        frame: Frame of the positions; None takes the mapping's.
        instrument: Covariance of a point where the file has no standard deviations; None is a
            laser tracker of 15 um + 5 um/m (bound, two sigma) three metres away.
        relation: Of the controller's axes to the joints, for a mapping of such axes.

    Raises:
        FormatError: A column is missing or unknown, or a cell is not what it should be.
    """
    columns = MappedSheet(sheet, mapping)
    position, covariance = point_columns(columns, instrument or default_instrument)
    rotation, rotation_covariance = rotation_columns(columns)
    group, names = _sets(columns)
    return MeasurementSet(
        joints=read_joint_columns(columns, relation),
        position=position,
        covariance=covariance,
        frame=frame or mapping.frame,
        rotation=rotation,
        rotation_covariance=rotation_covariance,
        wrench=wrench_columns(columns),
        payload_mass=payload_column(columns),
        payload_com=columns.numbers("payload_com", absent=np.nan) * LENGTH[mapping.position_unit],
        approach=approach_columns(columns),
        temperature=columns.numbers("temperature", absent=np.nan)[:, 0] + _ZERO_CELSIUS,
        target=columns.whole("target"),
        station=columns.whole("station"),
        group=group,
        group_names=names,
        source_row=np.array(sheet.lines),
        sources=tuple(f"{Path(sheet.source).name} sha256:{sheet.digest}" for _ in names),
        provenance=sheet.provenance,
    )


def read_joint_columns(columns: MappedSheet, relation: AxisRelation | None = None) -> Array:
    """Returns joints (n, dof) in rad.

    Raises:
        FormatError: Axes of the controller, and nobody says how it counts them.
    """
    mapping = columns.mapping
    if mapping.axes == "controller":
        if relation is None:
            raise columns.sheet.fault(
                f"columns {', '.join(mapping.joints)} are axes of the controller, and no robot "
                "says how they count.",
                "read the file with a cell or a model.",
            )
        return relation(columns.numbers("joints") * ANGLE[mapping.joints_unit])
    values = columns.numbers("joints")
    if mapping.joints_sign:
        values = values * np.asarray(mapping.joints_sign)
    if mapping.joints_offset:
        values = values + np.asarray(mapping.joints_offset)
    return values * ANGLE[mapping.joints_unit]


def wrench_columns(columns: MappedSheet) -> Array:
    """Returns the wrench (n, 6) N, N m; zero where the file has none."""
    return np.hstack([columns.numbers(group, absent=0.0) for group in ("force", "moment")])


def payload_column(columns: MappedSheet) -> Array:
    """Returns the payload (n,) kg; NaN ("the cell's") where the file has none."""
    values = columns.numbers("payload_mass", absent=np.nan)
    columns.check("payload_mass", values, values < 0.0, "0 or more")
    return values[:, 0]


def approach_columns(columns: MappedSheet) -> Array:
    """Returns the approach signs (n, dof); zero (unknown) where the file has none."""
    values = columns.numbers("approach", absent=0.0)
    columns.check("approach", values, ~np.isin(values, (-1.0, 0.0, 1.0)), "-1, 0 or 1")
    return values


def point_columns(columns: MappedSheet, instrument: Instrument) -> tuple[Array, Array]:
    """Returns points (n, 3) m and their covariance (n, 3, 3) m^2; the instrument's by default."""
    position = _position(columns)
    return position, _covariance(columns, position, instrument)


def _position(columns: MappedSheet) -> Array:
    mapping = columns.mapping
    values = columns.numbers("position")
    if mapping.position_minus:
        values = values - columns.numbers("position_minus")
    sign, offset = np.array(mapping.position_sign), np.array(mapping.position_offset)
    return np.asarray((sign * values + offset) * LENGTH[mapping.position_unit])


def _covariance(columns: MappedSheet, position: Array, instrument: Instrument) -> Array:
    if not columns.present("position_std"):
        return instrument(position)
    unit = LENGTH[columns.mapping.position_unit]
    std = columns.numbers("position_std")
    columns.check("position_std", std, std <= 0.0, "above 0")
    out = (std * unit)[:, :, None] ** 2 * np.eye(3)
    if columns.present("position_correlation"):
        shared = columns.numbers("position_correlation") * unit**2
        sign = np.asarray(columns.mapping.position_sign)
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            out[:, i, j] = out[:, j, i] = shared[:, k] * sign[i] * sign[j]
        bad = np.flatnonzero(np.linalg.eigvalsh(out)[:, 0] <= 0.0)
        if bad.size:
            raise columns.fault(
                int(bad[0]),
                columns.mapping.position_correlation[0],
                "larger than the standard deviations allow",
            )
    return out


def _sets(columns: MappedSheet) -> tuple[IntArray, tuple[str, ...]]:
    if not columns.present("set_name"):
        return np.zeros(len(columns), np.int64), (Path(columns.sheet.source).stem,)
    words = columns.sheet.words(*columns.mapping.set_name)
    names = tuple(dict.fromkeys(words))
    number = {name: i for i, name in enumerate(names)}
    return np.array([number[word] for word in words]), names
