"""From named columns of text to a MeasurementSet: the one reader behind every instrument."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import (
    matrix_from_abc,
    matrix_from_intrinsic_xyz,
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
)
from robotrue.errors import FormatError
from robotrue.measurement.formats.mapping import ANGLE, GROUPS, LENGTH, ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.tracker import Instrument, default_instrument

_ZERO_CELSIUS = 273.15


class MappedSheet:
    """The columns a mapping names in a sheet, as numbers.

    Raises:
        FormatError: On the first column that is missing, unknown or not a number.
    """

    def __init__(self, sheet: Sheet, mapping: ColumnMapping) -> None:
        self.sheet = sheet
        self.mapping = mapping
        self._constants = {column_key(name): value for name, value in mapping.constants.items()}
        for group in GROUPS:
            names = getattr(mapping, group)
            missing = [name for name in names if not self._has(name)]
            whole = group not in mapping.optional or len(missing) < len(names)
            if missing and whole:
                hint = f"name the columns in a mapping (layout here: {mapping.name!r})."
                raise sheet.lacking_columns(missing, hint)
        if not mapping.ignore_other:
            sheet.refuse_others(mapping.columns())

    def __len__(self) -> int:
        return len(self.sheet)

    def _has(self, name: str) -> bool:
        return self.sheet.has(name) or column_key(name) in self._constants

    def present(self, group: str) -> bool:
        """Returns True if the file (or a constant) has the group."""
        names = getattr(self.mapping, group)
        return bool(names) and all(self._has(name) for name in names)

    def numbers(self, group: str, *, absent: float | None = None) -> Array:
        """Returns the group's columns (n, k) in the file's units, every value finite.

        Args:
            group: A field of the mapping.
            absent: What all values are where the file has no such columns; None: they are there.
        """
        names = getattr(self.mapping, group)
        if absent is not None and not self.present(group):
            return np.full((len(self), self.mapping.count(group)), absent)
        return np.stack([self._column(name) for name in names], axis=1)

    def whole(self, group: str) -> IntArray:
        """Returns a column of whole numbers from 0 (n,); zeros where the file has none."""
        values = self.numbers(group, absent=0.0)[:, 0]
        bad = (values != np.round(values)) | (values < 0)
        self.check(group, values[:, None], bad, "a number 0, 1, 2 ...")
        return values.astype(np.int64)

    def _column(self, name: str) -> Array:
        if not self.sheet.has(name):
            return np.full(len(self), self._constants[column_key(name)])
        values = self.sheet.parse(name)
        for row in np.flatnonzero(~np.isfinite(values)).tolist():
            cell = self.sheet.column(name)[row]
            raise self.fault(row, name, _describe_cell(cell, self.sheet.decimal))
        return values

    def check(self, group: str, values: Array, bad: npt.ArrayLike, expected: str) -> None:
        """Passes if no value (n, k) of a group is bad (n, k).

        Raises:
            FormatError: The first that is, with what is expected.
        """
        for row, k in np.argwhere(np.reshape(bad, values.shape)).tolist():
            name = getattr(self.mapping, group)[k]
            raise self.fault(row, name, f"{values[row, k]:g}, expected {expected}")

    def fault(self, row: int, name: str, what: str) -> FormatError:
        """Returns the error for one cell: file, line, column and what is there."""
        return self.sheet.fault(
            f"column {name!r} is {what}.", "correct or delete that row.", row=row
        )


def _describe_cell(cell: str, decimal: str) -> str:
    if not cell:
        return "blank, expected a number"
    if "," in cell or "." in cell:
        return f"{cell!r}, expected a number with decimal mark {decimal!r} and no separators"
    return f"{cell!r}, expected a finite number"


def read_table(
    sheet: Sheet,
    mapping: ColumnMapping,
    *,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
) -> MeasurementSet:
    """Returns the measurements of a sheet.

    Args:
        sheet: From :func:`robotrue.measurement.formats.sheet.read_sheet`.
        mapping: What the columns hold.
        frame: Frame of the positions; None takes the mapping's.
        instrument: Covariance of a point where the file has no standard deviations; None is a
            laser tracker of 15 um + 5 um/m (bound, two sigma) three metres away.

    Raises:
        FormatError: A column is missing or unknown, or a cell is not what it should be.
    """
    columns = MappedSheet(sheet, mapping)
    position = _position(columns)
    rotation, rotation_covariance = _rotation(columns)
    group, names = _sets(columns)
    return MeasurementSet(
        joints=joint_columns(columns),
        position=position,
        covariance=_covariance(columns, position, instrument or default_instrument),
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


def joint_columns(columns: MappedSheet) -> Array:
    """Returns joints (n, dof) in rad."""
    mapping = columns.mapping
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


def _rotation(columns: MappedSheet) -> tuple[Array, Array]:
    n, mapping = len(columns), columns.mapping
    missing = np.full((n, 3, 3), np.nan)
    if not columns.present("rotation"):
        return missing, missing
    values = columns.numbers("rotation")
    form = mapping.rotation_form
    if form in ("wxyz", "xyzw"):
        quat_wxyz = values if form == "wxyz" else values[:, [3, 0, 1, 2]]
        bad = np.flatnonzero(np.abs(np.linalg.norm(quat_wxyz, axis=1) - 1.0) > 1e-3)
        if bad.size:
            row = int(bad[0])
            length = np.linalg.norm(quat_wxyz[row])
            raise columns.fault(
                row, mapping.rotation[0], f"part of a quaternion of length {length:g}"
            )
        return matrix_from_quat_wxyz(quat_wxyz), missing
    angles = values * ANGLE[mapping.rotation_unit]
    if form == "rotation_vector":
        return matrix_from_rotation_vector(angles), missing
    intrinsic = form == "rx_ry_rz"
    matrix = matrix_from_intrinsic_xyz(angles) if intrinsic else matrix_from_abc(angles[:, ::-1])
    if not columns.present("rotation_std"):
        return matrix, missing
    std = columns.numbers("rotation_std")
    columns.check("rotation_std", std, std <= 0.0, "above 0")
    axes: Array = _euler_axes(angles, intrinsic)
    scaled: Array = axes * (std * ANGLE[mapping.rotation_unit])[:, None, :]
    return matrix, scaled @ np.swapaxes(scaled, 1, 2)


def _euler_axes(angles: Array, intrinsic: bool) -> Array:
    """Returns (n, 3, 3): column k is the axis about which angle k (rx, ry, rz) turns."""
    alone = np.zeros((3, *angles.shape))
    for k in range(3):
        alone[k, :, k] = angles[:, k]
    rx, ry, rz = (matrix_from_abc(a[:, ::-1]) for a in alone)
    x, y, z = np.eye(3)
    n = (len(angles), 3)
    if intrinsic:
        columns = [np.broadcast_to(x, n), rx @ y, (rx @ ry) @ z]
    else:
        columns = [(rz @ ry) @ x, rz @ y, np.broadcast_to(z, n)]
    return np.stack(columns, axis=2)


def _sets(columns: MappedSheet) -> tuple[IntArray, tuple[str, ...]]:
    if not columns.present("set_name"):
        return np.zeros(len(columns), np.int64), (Path(columns.sheet.source).stem,)
    words = columns.sheet.words(*columns.mapping.set_name)
    names = tuple(dict.fromkeys(words))
    number = {name: i for i, name in enumerate(names)}
    return np.array([number[word] for word in words]), names
