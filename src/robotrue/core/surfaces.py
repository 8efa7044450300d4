"""Surfaces of a part that a probe can touch: planes, cylinders, meshes. Part frame, metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.errors import ShapeError


class Surface(Protocol):
    """Anything that can say how far a point is from it, and in which direction."""

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m, positive outside, and outward normals (n, 3).

        Args:
            points: (n, 3) m in part.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(Columns):
    """A plane face.

    Attributes:
        point: (3,) m, any point of it.
        normal: (3,) out of the material; normalised.
    """

    point: Annotated[Array, Column("3", unit="m")]
    normal: Annotated[Array, Column("3")]

    def _check_rules(self) -> None:
        """Normalises.

        Raises:
            ShapeError: A normal of length zero.
        """
        self._set_column("normal", _unit(self.normal, "normal"))

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m and the normal (n, 3)."""
        distance = (points - self.point) @ self.normal
        return distance, np.broadcast_to(self.normal, points.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder(Columns):
    """A round boss or, with ``hole``, a bore; without ends.

    Attributes:
        point: (3,) m, any point of the axis.
        axis: (3,) along it; normalised.
        radius: m.
        hole: True where the material is outside.
    """

    point: Annotated[Array, Column("3", unit="m")]
    axis: Annotated[Array, Column("3")]
    radius: float
    hole: bool = False

    def _check_rules(self) -> None:
        """Normalises.

        Raises:
            ShapeError: An axis of length zero or a radius that is not positive.
        """
        self._set_column("axis", _unit(self.axis, "axis"))
        if not 0.0 < self.radius < np.inf:
            raise ShapeError(f"radius is {self.radius:g} m, expected a positive number.")

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m and normals (n, 3).

        Fails when: a point lies on the axis; any direction across it then serves.
        """
        across = points - self.point
        across = across - (across @ self.axis)[:, None] * self.axis
        length = np.linalg.norm(across, axis=1)
        aside = np.eye(3)[int(np.argmin(np.abs(self.axis)))]
        aside = np.cross(self.axis, aside)
        on_axis = length < 1e-12
        normal = np.where(on_axis[:, None], aside, across / np.where(on_axis, 1.0, length)[:, None])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        sign = -1.0 if self.hole else 1.0
        return sign * (length - self.radius), sign * normal


def _unit(vector: Array, name: str) -> Array:
    v = frozen(vector, (3,), name)
    length = float(np.linalg.norm(v))
    if length < 1e-9:
        raise ShapeError(f"{name} has length {length:g}, expected a direction.")
    unit: Array = frozen(v / length, (3,), name)
    return unit
