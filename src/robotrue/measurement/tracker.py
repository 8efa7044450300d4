"""Covariance of one measured point from an instrument's data sheet.

In the tracker's spherical frame, with r the range (static error of a polar instrument):

    Sigma = R diag(sigma_r^2, sigma_t^2, sigma_t^2) R^T
    sigma = (bound + bound_per_m r) / divisor

where the first axis of R is the line of sight and sigma_t is what the two angles make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError

Instrument: TypeAlias = Callable[[Array], Array]
"""Positions (n, 3) m in the frame of the measurement to covariances (n, 3, 3) m^2 in that frame."""

DEFAULT_RANGE: Final = 3.0
"""m; default where the tracker's position is not stated. Typical of a robot cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSpecification:
    """Bounds on the error of one point, along the line of sight and across it.

    A bound (maximum permissible error) is not a standard deviation: the divisor converts it. Makers
    give one pair, "15 um + 6 um/m", for both directions; a separate distance meter has its own.

    Attributes:
        name: Name in reports.
        range_bound: m, along the line of sight at zero range.
        range_bound_per_m: m per m of range.
        angle_bound: m, across the line of sight at zero range.
        angle_bound_per_m: m per m of range (rad).
        divisor: Bound divided by this is one sigma; 2 reads a bound as two sigma.
    """

    name: str
    range_bound: float
    range_bound_per_m: float
    angle_bound: float
    angle_bound_per_m: float
    divisor: float = 2.0

    def __post_init__(self) -> None:
        """Checks that every sigma is positive.

        Raises:
            ConfigurationError: A negative bound, two zero bounds, or a divisor of zero or less.
        """
        for part in ("range", "angle"):
            fixed = getattr(self, f"{part}_bound")
            slope = getattr(self, f"{part}_bound_per_m")
            if not (fixed >= 0.0 and slope >= 0.0 and 0.0 < fixed + slope < np.inf):
                raise ConfigurationError(
                    f"tracker {self.name!r}: {part} bound {fixed / UM:g} um + {slope / UM:g} um/m, "
                    "expected two numbers that are not negative and not both zero."
                )
        if not 0.0 < self.divisor < np.inf:
            raise ConfigurationError(
                f"tracker {self.name!r}: divisor {self.divisor:g}, expected above 0.",
                hint="2 reads the bound as two sigma.",
            )

    def sigma_range(self, distance: Array) -> Array:
        """Returns one sigma along the line of sight, m, for ranges in m."""
        return np.asarray((self.range_bound + self.range_bound_per_m * distance) / self.divisor)

    def sigma_angle(self, distance: Array) -> Array:
        """Returns one sigma across the line of sight, m, for ranges in m."""
        return np.asarray((self.angle_bound + self.angle_bound_per_m * distance) / self.divisor)


def _bound(name: str, fixed_um: float, um_per_m: float) -> TrackerSpecification:
    return TrackerSpecification(
        name=name,
        range_bound=fixed_um * UM,
        range_bound_per_m=um_per_m * UM,
        angle_bound=fixed_um * UM,
        angle_bound_per_m=um_per_m * UM,
    )


TRACKERS: Final[Mapping[str, TrackerSpecification]] = MappingProxyType(
    {
        "AT960": _bound("Leica AT960", 15.0, 6.0),
        "API T3": _bound("API T3", 15.0, 5.0),
        "GTS3800": _bound("GTS3800", 15.0, 6.0),
    }
)
"""Printed bounds of U(xyz); read as two sigma."""

DEFAULT_SPECIFICATION: Final = _bound("laser tracker, 15 um + 5 um/m", 15.0, 5.0)


def one_sigma(sigma: float, sigma_per_m: float = 0.0) -> TrackerSpecification:
    """Returns a specification given as one standard deviation per axis (m, m per m of range)."""
    return TrackerSpecification(
        name="one sigma, as given",
        range_bound=sigma,
        range_bound_per_m=sigma_per_m,
        angle_bound=sigma,
        angle_bound_per_m=sigma_per_m,
        divisor=1.0,
    )


def point_covariance(
    specification: TrackerSpecification, points: Array, tracker: Array | None
) -> Array:
    """Returns the covariance (n, 3, 3) in m^2 of measured points, in the frame of the points.

    Args:
        specification: The instrument.
        points: (n, 3) m.
        tracker: (3,) m, position of the instrument, in the frame of the points; None is the
            isotropic fallback at ``DEFAULT_RANGE``, with the larger of the two sigmas.

    Fails when: a point lies on the tracker itself; the line of sight is then arbitrary and x is
    taken.
    """
    points = np.asarray(points, dtype=np.float64)
    n = len(points)
    if tracker is None:
        distance = np.full(n, DEFAULT_RANGE)
        sigma = np.maximum(specification.sigma_range(distance), specification.sigma_angle(distance))
        return np.asarray(sigma[:, None, None] ** 2 * np.eye(3))
    ray = points - frozen(tracker, (3,), "tracker position")
    distance = np.linalg.norm(ray, axis=1)
    near = distance < 1e-9
    sight = np.where(near[:, None], [1.0, 0.0, 0.0], ray / np.where(near, 1.0, distance)[:, None])
    along = sight[:, :, None] * sight[:, None, :]
    range2 = specification.sigma_range(distance)[:, None, None] ** 2
    angle2 = specification.sigma_angle(distance)[:, None, None] ** 2
    # Both transverse sigmas are equal, so the two angle axes need no names: I - s s^T.
    return np.asarray(range2 * along + angle2 * (np.eye(3) - along))


def default_instrument(points: Array) -> Array:
    """Returns the covariance (n, 3, 3) m^2 used where neither file nor cell states one.

    A tracker of 15 um + 5 um/m, bound read as two sigma, at ``DEFAULT_RANGE``: 15 um per axis.
    """
    return point_covariance(DEFAULT_SPECIFICATION, points, None)
