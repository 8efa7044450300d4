"""The axis a spindle turns about, from one reflector on it measured at steps of a turn.

The points lie on a circle whose normal is the axis. Centre, normal and radius are the ones of least
squared distance of the points from the circle, in its plane and off it together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG, MM
from robotrue.errors import ConvergenceError, ImplausibleDataError, ObservabilityError

FEWEST: Final = 5
"""Fewest points whose residual from a circle in space determines its uncertainty."""
SHORTEST: Final = 120.0 * DEG
"""Arc below which centre and radius trade against each other."""
OUTLYING: Final = 5.0
"""Times the deviation of a point from which the largest residual is at fault."""
_STEPS: Final = 50
_TOLERANCE: Final = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True)
class SpindleAxis(Columns):
    """A circle in space, in the frame of the points.

    Attributes:
        direction: (3,) unit, out of the flange.
        centre: (3,) m, of the circle: a point of the axis.
        radius: m.
        covariance_centre: (3, 3) m^2.
        covariance_direction: (3, 3) rad^2, across the direction.
        residual: (n, 2) m, of each point: radial, and along the axis.
        arc: rad, the part of the turn that the points cover.
        scatter: m, deviation of one coordinate about the circle, or the stated one if larger.
    """

    direction: Annotated[Array, Column("3")]
    centre: Annotated[Array, Column("3", unit="m")]
    radius: float
    covariance_centre: Annotated[Array, Column("3 3", unit="m^2")]
    covariance_direction: Annotated[Array, Column("3 3", unit="rad^2")]
    residual: Annotated[Array, Column("n 2", unit="m")]
    arc: float
    scatter: float

    @property
    def angle_sigma(self) -> float:
        """Standard deviation of the direction across its least certain way, rad."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance_direction)[-1]))


def fit_spindle_axis(points: Array, sigma: float, *, source: str = "") -> SpindleAxis:
    """Returns the axis that points (n, 3) m turn about.

    Args:
        points: Of one reflector, in the flange frame or in that of a robot at rest.
        sigma: m, standard deviation of one coordinate of one point.
        source: File of the points, for messages.

    Raises:
        ObservabilityError: Fewer than five points, or an arc shorter than 120 deg.
        ImplausibleDataError: Points that are on no circle.
        ConvergenceError: No circle was found.
    """
    points = frozen(points, (None, 3), "points")
    if len(points) < FEWEST:
        raise ObservabilityError(
            f"{len(points)} points of the reflector, at least {FEWEST} are needed.",
            source=source or None,
            hint="turn the spindle by 45 deg between points: eight of them.",
        )
    middle = points.mean(axis=0)
    spread, axes = np.linalg.svd(points - middle)[1:]
    if not spread[1] > 1e-3 * spread[0]:
        raise ObservabilityError(
            "the points lie on a line: the reflector did not turn.",
            source=source or None,
            hint="turn the spindle by 45 deg between points: eight of them.",
        )
    frame = axes.T * np.sign(np.linalg.det(axes))
    local = (points - middle) @ frame
    values, residual, jacobian = _fit_circle(local)
    arc = _covered_arc(local[:, :2] - values[:2])
    if arc < SHORTEST:
        raise ObservabilityError(
            f"the points cover {arc / DEG:.0f} deg of the turn, at least {SHORTEST / DEG:.0f} deg "
            "are needed: centre and radius trade against each other.",
            source=source or None,
            hint="turn the spindle further; a full turn in steps of 45 deg is best.",
        )
    freedom = residual.size - len(values)
    scatter = max(float(np.sqrt(np.sum(residual**2) / freedom)), sigma)
    _refuse_outlier(residual, sigma, scatter, source)
    covariance = scatter**2 * np.linalg.inv(jacobian.T @ jacobian)
    direction = np.array([values[3], values[4], 1.0])
    length = np.linalg.norm(direction)
    unit = direction / length
    by_slope = (np.eye(3) - np.outer(unit, unit))[:, :2] / length
    world = frame @ unit
    sign = 1.0 if world[np.argmax(np.abs(world))] > 0.0 else -1.0
    turned = frame @ by_slope
    return SpindleAxis(
        direction=sign * world,
        centre=middle + frame @ values[:3],
        radius=float(values[5]),
        covariance_centre=frame @ covariance[:3, :3] @ frame.T,
        covariance_direction=turned @ covariance[3:5, 3:5] @ turned.T,
        residual=residual,
        arc=arc,
        scatter=scatter,
    )


def fit_flat_circle(points: Array) -> tuple[float, float, float]:
    """Returns x, y and radius (m) of the circle about z that points (n, 3) are on, to begin with.

    Of least squared power of the points, which a linear system gives.
    """
    x, y, _ = points.T
    columns = np.column_stack([2.0 * x, 2.0 * y, np.ones(len(x))])
    a, b, power = np.linalg.lstsq(columns, x * x + y * y, rcond=None)[0].tolist()
    return a, b, max(power + a**2 + b**2, 1e-12) ** 0.5


def _fit_circle(points: Array) -> tuple[Array, Array, Array]:
    """Centre (3), slopes of the normal (2) and radius; residuals (n, 2); derivative (2n, 6)."""
    x, y, radius = fit_flat_circle(points)
    values = np.array([x, y, 0.0, 0.0, 0.0, radius])
    for _ in range(_STEPS):
        residual, jacobian = _off_circle(points, values)
        step = np.linalg.lstsq(jacobian, -residual.ravel(), rcond=None)[0]
        values = values + step
        if np.abs(step).max() < _TOLERANCE:
            return values, *_off_circle(points, values)
    raise ConvergenceError(
        f"no circle fits the {len(points)} points: still moving by {np.abs(step).max():.3g} m.",
        hint="points of one reflector, the robot at rest.",
    )


def _off_circle(points: Array, values: Array) -> tuple[Array, Array]:
    """Radial and axial distance (n, 2) from a circle, and their derivative (2n, 6)."""
    direction = np.array([values[3], values[4], 1.0])
    length = float(np.linalg.norm(direction))
    unit = direction / length
    arm = points - values[:3]
    along = arm @ unit
    across = arm - along[:, None] * unit
    distance = np.linalg.norm(across, axis=1)
    outward = across / distance[:, None]
    by_slope = (np.eye(3) - np.outer(unit, unit))[:, :2] / length
    jacobian = np.empty((len(points), 2, 6))
    jacobian[:, 0, :3], jacobian[:, 1, :3] = -outward, -unit
    jacobian[:, 0, 3:5] = -(along[:, None] * (outward @ by_slope))
    jacobian[:, 1, 3:5] = arm @ by_slope
    jacobian[:, :, 5] = [-1.0, 0.0]
    residual = np.stack([distance - values[5], along], axis=-1)
    return residual, jacobian.reshape(-1, 6)


def _covered_arc(offset: Array) -> float:
    """Rad of the turn without its largest gap."""
    angle = np.sort(np.arctan2(offset[:, 1], offset[:, 0]))
    return float(2.0 * np.pi - np.diff(angle, append=angle[0] + 2.0 * np.pi).max())


def _refuse_outlier(residual: Array, sigma: float, scatter: float, source: str) -> None:
    size = np.linalg.norm(residual, axis=1)
    worst = int(np.argmax(size))
    if scatter > OUTLYING * sigma:
        raise ImplausibleDataError(
            f"the points are {scatter / MM:.4f} mm off a circle, {sigma / MM:.4f} mm are stated of "
            f"one; the worst is point {worst + 1} with {size[worst] / MM:.4f} mm.",
            source=source or None,
            hint="the robot at rest, one reflector, no play of the spindle; or --sigma-um.",
        )
