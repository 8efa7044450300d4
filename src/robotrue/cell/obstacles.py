"""Obstacles in the cell: boxes, spheres and half-spaces in the robot base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class Box(Columns):
    """A box along the base axes.

    Attributes:
        name: For messages.
        low: (3,) m, its lowest corner.
        high: (3,) m, its highest corner.
    """

    name: str
    low: Annotated[Array, Column("3", unit="m")]
    high: Annotated[Array, Column("3", unit="m")]

    def _check_rules(self) -> None:
        """Checks the corners.

        Raises:
            ConfigurationError: The box has no volume.
        """
        if not (self.low < self.high).all():
            raise ConfigurationError(
                f"obstacle {self.name!r}: the box has no volume.",
                hint="two opposite corners that differ in x, y and z.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere(Columns):
    """A ball.

    Attributes:
        name: For messages.
        centre: (3,) m.
        radius: m.
    """

    name: str
    centre: Annotated[Array, Column("3", unit="m")]
    radius: float

    def _check_rules(self) -> None:
        """Checks the radius.

        Raises:
            ConfigurationError: It is not positive.
        """
        if not self.radius > 0.0:
            raise ConfigurationError(
                f"obstacle {self.name!r}: radius {self.radius * 1e3:g} mm, expected above 0."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpace(Columns):
    """Everything on one side of a plane: a floor, a wall.

    Attributes:
        name: For messages.
        point: (3,) m on the plane.
        normal: (3,) out of the solid side; made a unit vector.
    """

    name: str
    point: Annotated[Array, Column("3", unit="m")]
    normal: Annotated[Array, Column("3")]

    def _check_rules(self) -> None:
        """Normalises.

        Raises:
            ConfigurationError: The normal is zero.
        """
        length = float(np.linalg.norm(self.normal))
        if not length > 0.0:
            raise ConfigurationError(
                f"obstacle {self.name!r}: the normal is zero.", hint="[0, 0, 1] for a floor."
            )
        self._set_column("normal", self.normal / length)


Obstacle: TypeAlias = Box | Sphere | HalfSpace
