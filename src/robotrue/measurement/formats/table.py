"""From named columns of text to a MeasurementSet: the common reader of all instruments.

Orientations are read in the conventions of controllers and trackers; monuments and repeated shots
of one pose are treated as the mapping states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final, TypeAlias, TypedDict

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.rotations import (
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
)
from robotrue.core.units import DEG, MM, ZERO_CELSIUS
from robotrue.measurement.formats.mapped_sheet import MappedSheet
from robotrue.measurement.formats.mapping import ANGLE, GROUPS, LENGTH, ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.frame_walk import MonumentShots, describe_walks, remove_walk
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.repeated_poses import average_repeats, describe_repeats
from robotrue.measurement.tracker import Instrument, default_instrument

AxisRelation: TypeAlias = Callable[[Array], Array]
"""The controller's axes (n, dof) rad to joints of the robot model (n, dof) rad."""


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
        FormatError: A column is missing or unknown, or a cell is invalid.
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
        **read_condition_columns(columns),
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
        FormatError: Axes of the controller, and no relation that states their convention.
    """
    mapping = columns.mapping
    if mapping.axes == "controller":
        if relation is None:
            raise columns.sheet.fault(
                f"columns {', '.join(mapping.joints)} are axes of the controller, and no robot "
                "states their convention.",
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


class ConditionColumns(TypedDict):
    """Conditions of n rows, as :class:`MeasurementSet` and ``join_conditions`` name them."""

    temperature: Array
    joint_temperature: Array
    time: Array
    external: Array


def read_condition_columns(columns: MappedSheet) -> ConditionColumns:
    """Returns temperature, time and external axes of every row; NaN where the file has none."""
    return {
        "temperature": _temperature_columns(columns, "temperature")[:, 0],
        "joint_temperature": _temperature_columns(columns, "joint_temperature"),
        "time": _time_column(columns),
        "external": _external_columns(columns),
    }


def _external_columns(columns: MappedSheet) -> Array:
    """Returns external axes (n, 6) m or rad; NaN where the file has none.

    Raises:
        FormatError: A column whose name has no unit.
    """
    out = np.full((len(columns), EXTERNAL_AXES), np.nan)
    for k, name in enumerate(columns.mapping.external):
        unit = EXTERNAL_UNITS.get(name.rpartition("_")[2].lower(), np.nan)
        if name and np.isnan(unit):
            raise columns.sheet.fault(
                f"column {name!r} of an external axis has no unit.", "end its name in _mm or _deg."
            )
        if name and columns.sheet.has(name):
            out[:, k] = unit * columns.column(name)
    return out


def _temperature_columns(columns: MappedSheet, group: str) -> Array:
    """Returns temperatures (n, k) K of a group; NaN where the file has none."""
    return columns.numbers(group, absent=np.nan) + ZERO_CELSIUS


def _time_column(columns: MappedSheet) -> Array:
    """Returns the time (n,) s of every row, of time stamps since 1970; NaN where the file has none.

    Raises:
        FormatError: A cell that is no date with time of day.
    """
    if not columns.present("timestamp"):
        return columns.numbers("time", absent=np.nan)[:, 0]
    name = columns.mapping.timestamp[0]
    seconds = np.empty(len(columns))
    for row, cell in enumerate(columns.sheet.column(name)):
        try:
            moment = datetime.fromisoformat(cell)
        except ValueError:
            raise columns.fault(row, name, f"{cell!r}, expected as 2026-11-28T07:30:00") from None
        seconds[row] = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return seconds


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


EXTERNAL_UNITS: Final[Mapping[str, float]] = {"mm": MM, "deg": DEG}
_X, _Y, _Z = range(3)
_FACTORS: Final[Mapping[str, tuple[tuple[int, int], ...]]] = {
    "rz_ry_rx": ((_Z, 2), (_Y, 1), (_X, 0)),
    "wpr": ((_Z, 2), (_Y, 1), (_X, 0)),
    "rpy": ((_Z, 2), (_Y, 1), (_X, 0)),
    "abc": ((_Z, 0), (_Y, 1), (_X, 2)),
    "rx_ry_rz": ((_X, 0), (_Y, 1), (_Z, 2)),
    "oat": ((_Z, 0), (_Y, 1), (_Z, 2)),
}
"""Rotations of a product from left to right: the axis, and the column that holds its angle."""
_QUATERNIONS: Final[Mapping[str, list[int]]] = {"wxyz": [0, 1, 2, 3], "xyzw": [3, 0, 1, 2]}
"""Columns of w, x, y, z."""


def rotation_columns(columns: MappedSheet) -> tuple[Array, Array]:
    """Returns matrices (n, 3, 3) and covariances (n, 3, 3) rad^2 of the left rotation vector.

    NaN where the file has none.

    Raises:
        FormatError: A quaternion that is not of length one, a deviation of zero or less.
    """
    missing = np.full((len(columns), 3, 3), np.nan)
    if not columns.present("rotation"):
        return missing, missing
    form, values = columns.mapping.rotation_form, columns.numbers("rotation")
    covariance = missing
    if form in _QUATERNIONS:
        matrix = _matrix_from_quaternion(columns, values[:, _QUATERNIONS[form]])
    elif form == "rotation_vector":
        matrix = matrix_from_rotation_vector(values * ANGLE[columns.mapping.rotation_unit])
    else:
        matrix, axes = _multiply_turns(form, values * ANGLE[columns.mapping.rotation_unit])
        covariance = _angle_covariance(columns, axes)
    if not columns.mapping.rotation_inverse:
        return matrix, covariance
    inverse = np.swapaxes(matrix, 1, 2)
    return inverse, inverse @ covariance @ matrix


def _matrix_from_quaternion(columns: MappedSheet, quat_wxyz: Array) -> Array:
    length = np.linalg.norm(quat_wxyz, axis=1)
    for row in np.flatnonzero(np.abs(length - 1.0) > 1e-3).tolist():
        raise columns.fault(
            row, columns.mapping.rotation[0], f"part of a quaternion of length {length[row]:g}"
        )
    return matrix_from_quat_wxyz(quat_wxyz)


def _multiply_turns(form: str, angles: Array) -> tuple[Array, Array]:
    """Returns the product (n, 3, 3), and as columns (n, 3, 3) the axis of each printed angle."""
    matrix = np.tile(np.eye(3), (len(angles), 1, 1))
    axes = np.empty((len(angles), 3, 3))
    for axis, column in _FACTORS[form]:
        axes[:, :, column] = matrix[:, :, axis]
        matrix = matrix @ matrix_from_rotation_vector(angles[:, column, None] * np.eye(3)[axis])
    return matrix, axes


def _angle_covariance(columns: MappedSheet, axes: Array) -> Array:
    if not columns.present("rotation_std"):
        return np.full((len(columns), 3, 3), np.nan)
    std = columns.numbers("rotation_std")
    columns.check("rotation_std", std, std <= 0.0, "above 0")
    scaled: Array = axes * (std * ANGLE[columns.mapping.rotation_unit])[:, None, :]
    return scaled @ np.swapaxes(scaled, 1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredRun:
    """Rows of one file, and how they came about.

    Attributes:
        rows: In the frame of the first shot of a monument, where there are monuments.
        remarks: One sentence each: joins, monuments, repeated shots.
    """

    rows: MeasurementSet
    remarks: tuple[str, ...]


def split_monuments(sheet: Sheet, mapping: ColumnMapping) -> Sheet:
    """Returns the sheet without its rows of monuments, which it carries apart."""
    if not mapping.monuments or not sheet.has(mapping.point_name[0]):
        return sheet
    patterns = [column_key(pattern) for pattern in mapping.monuments]
    names = map(column_key, sheet.column(mapping.point_name[0]))
    shot = [any(fnmatchcase(name, pattern) for pattern in patterns) for name in names]
    if not any(shot):
        return sheet
    poses = sheet.take(row for row, is_shot in enumerate(shot) if not is_shot)
    return replace(poses, monuments=sheet.take(np.flatnonzero(shot).tolist()))


def read_run(
    sheet: Sheet,
    mapping: ColumnMapping,
    *,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
    relation: AxisRelation | None = None,
) -> MeasuredRun:
    """Returns the rows of a sheet; arguments as those of ``read_table``.

    The order of the lines is the time of the run. The motion of the frame that monuments show is
    subtracted, then shots of one pose are averaged if the mapping states it.

    Raises:
        FormatError: A column is missing or unknown, or a cell is invalid.
        ShapeError: Monuments of which none was shot twice.
    """
    instrument = instrument or default_instrument
    rows = read_table(sheet, mapping, frame=frame, instrument=instrument, relation=relation)
    remarks = sheet.remarks
    if sheet.monuments is not None:
        shots = _read_shots(sheet.monuments, mapping, instrument)
        rows, walks = remove_walk(rows, shots, np.array(sheet.lines, dtype=np.float64))
        remarks += describe_walks(walks)
    if mapping.repeats == "mean":
        poses = average_repeats(rows)
        rows, remarks = poses.mean, remarks + describe_repeats(poses)
    return MeasuredRun(rows=rows, remarks=remarks)


def _read_shots(sheet: Sheet, mapping: ColumnMapping, instrument: Instrument) -> MonumentShots:
    others = tuple(group for group in GROUPS if group not in ("position", "point_name"))
    columns = MappedSheet(sheet, replace(mapping, optional=others))
    position, covariance = point_columns(columns, instrument)
    return MonumentShots(
        nest=sheet.words(mapping.point_name[0]),
        position=position,
        covariance=covariance,
        moment=np.array(sheet.lines, dtype=np.float64),
        station=columns.whole("station"),
    )
