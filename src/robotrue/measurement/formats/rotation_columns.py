"""Columns of measured orientations as matrices, in the conventions of controllers and trackers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import (
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
)
from robotrue.measurement.formats.mapped_sheet import MappedSheet
from robotrue.measurement.formats.mapping import ANGLE

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
