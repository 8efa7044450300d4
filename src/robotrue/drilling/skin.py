"""The skin under the foot: how far a curved surface falls away from its tangent plane."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError

SkinKind: TypeAlias = Literal["plane", "sphere", "cylinder"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Skin:
    """Shape of the surface within the foot.

    Attributes:
        kind: ``plane``: flat, or a foot that lies on its own plane and hides the skin's shape.
            ``sphere``: the same curvature in every direction. ``cylinder``: curved across
            ``axis`` only.
        radius: m, positive where the skin falls away from the spindle at its edges (a fuselage
            from outside), negative in a hollow; NaN where it is to be found from the readings.
        axis: rad from the foot's x axis to the line along which a cylinder is straight.
    """

    kind: SkinKind = "plane"
    radius: float = field(default=float("inf"))
    axis: float = 0.0

    def __post_init__(self) -> None:
        """Checks the kind and the radius."""
        if self.kind not in ("plane", "sphere", "cylinder"):
            raise ConfigurationError(
                f"skin {self.kind!r}, expected 'plane', 'sphere' or 'cylinder'."
            )
        if self.radius == 0.0:
            raise ConfigurationError("the skin's radius is 0 mm, expected another value.")

    @property
    def fitted(self) -> bool:
        """Whether the curvature is one more unknown of every reading."""
        return self.kind != "plane" and bool(np.isnan(self.radius))

    def shape(self, seat: Array) -> Array:
        """Returns (k,) m^2: half the squared distance that counts, so that fall = shape / radius.

        Args:
            seat: (k, 2) m, places of the sensors in the foot.
        """
        if self.kind == "plane":
            return np.zeros(len(seat))
        across = seat
        if self.kind == "cylinder":
            across = seat @ np.array([[-np.sin(self.axis)], [np.cos(self.axis)]])
        out: Array = 0.5 * np.sum(across**2, axis=1)
        return out

    def fall(self, seat: Array) -> Array:
        """Returns (k,) m: how much farther from the spindle than its tangent plane the skin lies.

        To second order in distance over radius, and only for a known radius.
        """
        if self.kind == "plane":
            return np.zeros(len(seat))
        return self.shape(seat) / self.radius


FLAT = Skin()
