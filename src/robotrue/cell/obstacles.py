"""What stands in the cell besides the robot: boxes, spheres and half-spaces in the robot base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A box along the base axes.

    Attributes:
        name: For messages.
        low: (3,) m, its lowest corner.
        high: (3,) m, its highest corner.
    """

    name: str
    low: Array
    high: Array

    def __post_init__(self) -> None:
        """Checks the corners.

        Raises:
            ConfigurationError: The box has no volume.
        """
        low, high = frozen(self.low, (3,), "low"), frozen(self.high, (3,), "high")
        if not (low < high).all():
            raise ConfigurationError(
                f"obstacle {self.name!r}: the box has no volume.",
                hint="two opposite corners that differ in x, y and z.",
            )
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere:
    """A ball.

    Attributes:
        name: For messages.
        centre: (3,) m.
        radius: m.
    """

    name: str
    centre: Array
    radius: float

    def __post_init__(self) -> None:
        """Checks the radius.

        Raises:
            ConfigurationError: It is not positive.
        """
        object.__setattr__(self, "centre", frozen(self.centre, (3,), "centre"))
        if not self.radius > 0.0:
            raise ConfigurationError(
                f"obstacle {self.name!r}: radius {self.radius * 1e3:g} mm, expected above 0."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpace:
    """Everything on one side of a plane: a floor, a wall.

    Attributes:
        name: For messages.
        point: (3,) m on the plane.
        normal: (3,) out of the solid side; made a unit vector.
    """

    name: str
    point: Array
    normal: Array

    def __post_init__(self) -> None:
        """Normalises.

        Raises:
            ConfigurationError: The normal is zero.
        """
        normal = np.asarray(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal))
        if not length > 0.0:
            raise ConfigurationError(
                f"obstacle {self.name!r}: the normal is zero.", hint="[0, 0, 1] for a floor."
            )
        object.__setattr__(self, "point", frozen(self.point, (3,), "point"))
        object.__setattr__(self, "normal", frozen(normal / length, (3,), "normal"))


Obstacle: TypeAlias = Box | Sphere | HalfSpace
