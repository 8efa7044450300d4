"""The pressure foot: displacement sensors around the spindle, and the plane they see.

A reading grows where the surface is farther along the spindle axis. With sensor i at
(x_i, y_i) = r_i (cos theta_i, sin theta_i) and the surface's normal n in the spindle's frame,

    d_i = h - (n_x x_i + n_y y_i) / n_z + fall_i.

It is linear in (n_x / n_z, n_y / n_z, h): any number of sensors is one least-squares solution, and
with three it is the exact inverse.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError

SkinKind: TypeAlias = Literal["plane", "sphere", "cylinder"]
READING_SIGMA_UM: Final = 2.0
MAX_TILT_DEG: Final = 8.0
"""Of a foot that does not state them."""
FLATTEST: Final = 1e-6
"""Smallest over largest singular value at which sensors still span a plane."""
SHUFFLED: Final = 6
"""Most sensors whose orders are all tried."""


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
        """True if the curvature of the surface is estimated from every reading."""
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
        """Returns (k,) m: distance of the skin beyond its tangent plane, seen from the spindle.

        To second order in distance over radius, and only for a known radius.
        """
        if self.kind == "plane":
            return np.zeros(len(seat))
        return self.shape(seat) / self.radius


FLAT: Final = Skin()


@dataclass(frozen=True, slots=True, kw_only=True)
class Foot(Columns):
    """Sensors of a pressure foot, in the frame of the spindle.

    Attributes:
        radius: (k,) m from the spindle axis.
        angle: (k,) rad about the spindle axis, from x towards y.
        skin: What the sensors touch.
        reading_sigma: m, scatter of one reading.
        reading_range: (2,) m, lowest and highest reading (less its zero) a sensor can give;
            infinite where it is not known.
        max_tilt: rad, largest tilt the foot can follow.
    """

    radius: Annotated[Array, Column("k", unit="m")]
    angle: Annotated[Array, Column("k", unit="rad")]
    skin: Skin = FLAT
    reading_sigma: float = READING_SIGMA_UM * UM
    reading_range: Annotated[Array, Column("2", unit="m", inf=True)] = field(
        default_factory=lambda: np.array([-np.inf, np.inf])
    )
    max_tilt: float = MAX_TILT_DEG * DEG

    def _check_rules(self) -> None:
        """Checks that the sensors span a plane."""
        limits = self.reading_range / MM
        if not limits[0] < limits[1]:
            raise ConfigurationError(
                f"the readings' range is {limits.tolist()} mm, expected lowest and highest."
            )
        if not self.reading_sigma > 0.0 or not self.max_tilt > 0.0:
            raise ConfigurationError("reading_sigma and max_tilt of a foot are above 0.")
        unknowns = 4 if self.skin.fitted else 3
        if len(self.radius) < unknowns:
            raise ConfigurationError(
                f"{len(self.radius)} sensors for {unknowns} unknowns.",
                hint="give at least three sensors, four where the curvature is to be found.",
            )
        spread = np.linalg.svd(self.design, compute_uv=False)
        if not spread[-1] > FLATTEST * spread[0]:
            raise ConfigurationError(
                "the sensors lie on one line, or their places do not separate tilt from curvature.",
                hint="spread them around the spindle and, for the curvature, over two radii.",
            )

    @property
    def seat(self) -> Array:
        """(k, 2) m, places of the sensors."""
        out: Array = self.radius[:, None] * np.stack(
            [np.cos(self.angle), np.sin(self.angle)], axis=-1
        )
        return out

    @property
    def design(self) -> Array:
        """(k, 3 or 4): readings from slopes (n_x/n_z, n_y/n_z), height over the radius, curvature.

        Height and curvature are in units of the mean radius, so that columns compare.
        """
        scale = float(np.mean(self.radius))
        columns = [-self.seat, np.full((len(self.radius), 1), scale)]
        if self.skin.fitted:
            columns.append(self.skin.shape(self.seat)[:, None] / scale)
        return np.concatenate(columns, axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenZero(Columns):
    """A zero that readings are less, as its foot file states it.

    Attributes:
        readings: (k,) m, on the calibration tool.
        tilt_sigma: (2,) rad, what it leaves uncertain of every tilt a, b; 0 where not stated.
    """

    readings: Annotated[Array, Column("k", unit="m")]
    tilt_sigma: Annotated[Array, Column("2", unit="rad")]


@dataclass(frozen=True, slots=True, kw_only=True)
class FootPlane:
    """The plane under the foot, n of them.

    Attributes:
        normal: (n, 3) unit, in the spindle's frame, z > 0.
        height: (n,) m along the spindle axis.
        curvature: (n,) 1/m found from the readings; of the skin where that is known.
        residual: (n, k) m, readings less those of the plane: zero with three sensors.
        slope_covariance: (2, 2) of n_x/n_z and n_y/n_z from the readings' scatter alone.
    """

    normal: Array
    height: Array
    curvature: Array
    residual: Array
    slope_covariance: Array


def readings(foot: Foot, normal: Array, height: Array) -> Array:
    """Returns the readings (n, k) m of a foot on a plane with these normals.

    Args:
        foot: The sensors; a known curvature counts.
        normal: (n, 3) unit, in the spindle's frame, z > 0.
        height: (n,) m along the spindle axis.
    """
    normal = frozen(np.atleast_2d(normal), (None, 3), "normal")
    slope = normal[:, :2] / normal[:, 2:]
    fall = 0.0 if foot.skin.fitted else foot.skin.fall(foot.seat)
    out: Array = np.reshape(height, (-1, 1)) - slope @ foot.seat.T + fall
    return out


def sensor_orders(count: int) -> Iterator[tuple[int, ...]]:
    """Yields the possible orders of sensors, the stated one first; none of many sensors."""
    yield from permutations(range(count)) if count <= SHUFFLED else ()


def exchanged_columns(order: Sequence[int]) -> str:
    """Returns which column is which sensor where an order differs from that of the sensors."""
    moved = [(p, k) for k, p in enumerate(order) if p != k]
    return ", ".join(f"column {p + 1} is sensor {k + 1}" for p, k in moved)


def plane_under(foot: Foot, reading: Array) -> FootPlane:
    """Returns the plane each set of readings lies on, by least squares.

    Args:
        foot: The sensors.
        reading: (n, k) m, less their zero.

    Raises:
        ShapeError: Not one reading per sensor, or one that is not finite.
    """
    d = frozen(np.atleast_2d(reading), (None, len(foot.radius)), "readings")
    fall = np.zeros(len(foot.radius)) if foot.skin.fitted else foot.skin.fall(foot.seat)
    inverse = np.linalg.pinv(foot.design)
    found = (d - fall) @ inverse.T
    slope = found[:, :2]
    normal = np.concatenate([slope, np.ones((len(d), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    scale = float(np.mean(foot.radius))
    known = 0.0 if foot.skin.kind == "plane" else 1.0 / foot.skin.radius
    return FootPlane(
        normal=normal,
        height=found[:, 2] * scale,
        curvature=found[:, 3] / scale if foot.skin.fitted else np.full(len(d), known),
        residual=d - fall - found @ foot.design.T,
        slope_covariance=foot.reading_sigma**2 * inverse[:2] @ inverse[:2].T,
    )
