"""How the printed equations of Feng, Liang, Xi 2018 can be read, and which reading works.

J. Xiamen Univ. Nat. Sci. 57(5), 722-728. Every reading but the first of each is wrong. They are
here to measure their effect, and to document that they were tried.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

import numpy as np

from robotrue.cell.registration.baselines import feature_frame
from robotrue.cell.registration.fit import check_pattern
from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.errors import ConfigurationError
from robotrue_reproductions.feng2018.three_point_recursion import Correction

SecondAxis: TypeAlias = Literal["a x n", "n x a"]
Attitude: TypeAlias = Literal["feature in base", "base in feature"]
AngleValues: TypeAlias = Literal["text", "equation 15"]
AngleLabels: TypeAlias = Literal["equation 3", "text under equation 3"]
ShiftAxes: TypeAlias = Literal["base", "feature"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationReadings:
    """Which way each equation is read.

    Attributes:
        second_axis: Eq. 11. ``a x n`` is right-handed; ``n x a``, as printed, has determinant -1,
            and the angles taken from it turn the model the wrong way about two axes.
        attitude: Eq. 12. ``feature in base`` is [n o a]; ``base in feature`` is its transpose, as
            printed, inserted into eq. 13 as printed.
        angle_values: Eq. 15. ``text``: z 3, y 2.3, x 3.5 deg; ``equation 15`` exchanges the first
            and the last.
        angle_labels: Under eq. 3 the text turns Z, Y, X by alpha, beta, gamma; the product in the
            equation by gamma, beta, alpha. With both exchanges the angles are right again.
        shift_axes: Eq. 14 gives the shift in ``base`` axes; the text moves the model by it along
            the ``feature`` axes.
    """

    second_axis: SecondAxis = "a x n"
    attitude: Attitude = "feature in base"
    angle_values: AngleValues = "text"
    angle_labels: AngleLabels = "equation 3"
    shift_axes: ShiftAxes = "base"

    def __post_init__(self) -> None:
        """Checks the words.

        Raises:
            ConfigurationError: A reading that does not exist.
        """
        for name, kind in (
            ("second_axis", SecondAxis),
            ("attitude", Attitude),
            ("angle_values", AngleValues),
            ("angle_labels", AngleLabels),
            ("shift_axes", ShiftAxes),
        ):
            value = getattr(self, name)
            if value not in get_args(kind):
                allowed = ", ".join(repr(word) for word in get_args(kind))
                raise ConfigurationError(f"{name} is {value!r}, expected one of {allowed}.")

    @property
    def sound(self) -> bool:
        """True if the recursion with these readings ends where it should."""
        exchanged = (self.angle_values != "text") != (self.angle_labels != "equation 3")
        return self.second_axis == "a x n" and self.attitude == "feature in base" and not exchanged


CORRECTED: Final = EquationReadings()
"""Every equation as it must be read."""


def attitude(points: Array, readings: EquationReadings = CORRECTED) -> Array:
    """Returns the feature's attitude (3, 3) from K, L, M, eq. 9-12, as the readings have it.

    Args:
        points: (3, 3) m, K, L, M.
        readings: Corrected: a rotation, feature in base.

    Raises:
        ObservabilityError: Points on one line.
    """
    check_pattern(np.asarray(points, dtype=np.float64), ("K", "L", "M"))
    to_l, to_m = points[1] - points[0], points[2] - points[0]
    n = to_l / np.linalg.norm(to_l)
    a = np.cross(to_l, to_m)
    a = a / np.linalg.norm(a)
    o = np.cross(a, n) if readings.second_axis == "a x n" else np.cross(n, a)
    axes = np.stack([n, o, a], axis=1)
    return axes if readings.attitude == "feature in base" else axes.T


def turn_angles(model: Array, touched: Array, readings: EquationReadings = CORRECTED) -> Array:
    """Returns the angles (3,) rad to turn the model about its z, y, x, in that order.

    Eq. 13: touched = model Rz(gamma) Ry(beta) Rx(alpha), with attitudes as ``readings`` has them.

    Args:
        model: (3, 3) m, K, L, M of the model.
        touched: (3, 3) m, the same on the part.
        readings: Of the equations.
    """
    between = attitude(model, readings).T @ attitude(touched, readings)
    angles = abc_from_matrix(between)
    for exchanged in (
        readings.angle_values == "equation 15",
        readings.angle_labels == "text under equation 3",
    ):
        if exchanged:
            angles = angles[::-1]
    return np.ascontiguousarray(angles)


def turn(angles: Array) -> Array:
    """Returns Rz Ry Rx (3, 3), eq. 15's product, of angles (3,) rad about z, y, x."""
    return matrix_from_abc(angles)


def correction_of(readings: EquationReadings) -> Correction:
    """Returns the correction of a pass of the recursion, with the equations as read."""

    def correct(model: Array, touched: Array) -> tuple[Array, Array]:
        angles = turn_angles(model, touched, readings)
        shift = touched[0] - model[0]
        if readings.shift_axes == "feature":
            # The numbers of base axes, read as distances along axes that have already been turned.
            shift = feature_frame(model)[:3, :3] @ turn(angles) @ shift
        return angles, shift

    return correct
