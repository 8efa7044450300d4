"""Position, size and roundness of a hole from points measured on its wall.

``contour`` is the distance from the *nominal* circle about the fitted axis: Table 11 of Deng et al.
2022, which does not define its contour error, prints a mean (0.269 mm) nearly four times its
standard deviation (0.071 mm), as such distances have. ``form`` is the deviation from the *fitted*
circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.cell.spindle_axis import fit_flat_circle
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError, ImplausibleDataError, ShapeError

_STEPS: Final = 50
_TOLERANCE: Final = 1e-11  # m, and slope
_TALL: Final = 0.1  # height over radius from which the direction of the axis is fitted


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleCylinder:
    """A least-squares cylinder with its axis near z.

    Attributes:
        centre: (2,) m, where the axis meets the plane z = 0.
        slope: (2,) dx/dz and dy/dz of the axis.
        radius: m.
    """

    centre: Array
    slope: Array
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleResult(Columns):
    """A measured hole against its drawing, SI, part axes.

    Attributes:
        position_error: (2,) m, axis at the top face minus nominal centre.
        cylinder: The fit.
        contour: (n,) m, distance from the fitted axis minus nominal radius.
        form: (n,) m, distance from the fitted axis minus fitted radius.
        angle: (n,) rad, of each point about the nominal centre.
        deviation: (n, 2) m, radial deviation from the nominal hole in its nominal place, as a
            vector.
    """

    position_error: Annotated[Array, Column("2", unit="m")]
    cylinder: HoleCylinder
    contour: Annotated[Array, Column("_", unit="m")]
    form: Annotated[Array, Column("_", unit="m")]
    angle: Annotated[Array, Column("_", unit="rad")]
    deviation: Annotated[Array, Column("_ 2", unit="m")]

    @property
    def position(self) -> float:
        """Length of the position error, m."""
        return float(np.linalg.norm(self.position_error))

    @property
    def diameter(self) -> float:
        """Diameter of the fitted cylinder, m."""
        return 2.0 * self.cylinder.radius

    @property
    def roundness(self) -> float:
        """Largest less smallest distance from the fitted axis, m (least squares, ISO 12181)."""
        return float(np.ptp(self.form))


def fit_cylinder(points: Array) -> HoleCylinder:
    """Returns the cylinder of least squared radial distance, axis within 45 deg of z.

    Args:
        points: (n, 3) m, on the wall.

    Fails when: the points span less height than a tenth of the radius; they do not determine the
    direction of the axis, and it is held along z. Or they lie on less than about a third of the
    turn; centre and radius then trade against each other.

    Raises:
        ShapeError: Fewer than six points, or not finite.
        ConvergenceError: The points are on no cylinder near z.
    """
    points = frozen(points, (None, 3), "points")
    if len(points) < 6:
        raise ShapeError(f"{len(points)} points on the wall, expected at least 6.")
    x, y, radius = fit_flat_circle(points)
    values = np.array([x, y, 0.0, 0.0, radius])
    columns = _free_columns(points, float(values[4]))
    for _ in range(_STEPS):
        residual, jacobian = _radial(points, values)
        step = np.linalg.lstsq(jacobian[:, columns], -residual, rcond=None)[0]
        values[columns] += step
        if np.abs(step).max() < _TOLERANCE:
            return HoleCylinder(centre=values[:2], slope=values[2:4], radius=float(values[4]))
    raise ConvergenceError(
        f"no cylinder fits the {len(points)} points: still moving by "
        f"{np.abs(step).max():.3g} m after {_STEPS} steps.",
        hint="check that the points are in part coordinates, z along the hole.",
    )


OTHER_SIZE: Final = 0.2
"""Share of the nominal radius by which another hole, or another unit, is off."""
WIDEST_GAP: Final = np.radians(240.0)
"""Of the turn without points, beyond which centre and radius trade against each other."""


def require_turn(points: Array, centre: Array, *, source: str) -> None:
    """Checks that points (n, 3) m surround enough of the hole about ``centre`` (2,) m.

    Raises:
        ImplausibleDataError: They lie on less than a third of the turn.
    """
    angle = np.sort(np.arctan2(points[:, 1] - centre[1], points[:, 0] - centre[0]))
    gap = float(np.diff(angle, append=angle[0] + 2.0 * np.pi).max())
    if gap > WIDEST_GAP:
        raise ImplausibleDataError(
            f"the points lie on {360.0 - np.degrees(gap):.0f} deg of the turn, at least 120 deg "
            "are needed: centre and diameter trade against each other.",
            source=source,
            hint="probe the wall all around; --centre-mm is the centre in the points' frame.",
        )


def require_size(result: HoleResult, radius: float, *, source: str) -> None:
    """Passes if a hole is of about its nominal radius (m).

    Raises:
        ImplausibleDataError: A diameter that is off by more than a fifth.
    """
    if abs(result.cylinder.radius - radius) > OTHER_SIZE * radius:
        raise ImplausibleDataError(
            f"the points are of a hole of {result.diameter / MM:.3f} mm, nominal are "
            f"{2.0 * radius / MM:g} mm.",
            source=source,
            hint="x_mm, y_mm, z_mm in mm (not inches or metres), and --diameter-mm of this hole.",
        )


def hole_uncertainty(points: Array, result: HoleResult, probe_sigma: float) -> tuple[Array, float]:
    """Returns the standard deviation of the position (2,) m and of the diameter, m.

    Each point counts with the deviation of one probed point or with the form of this hole about the
    cylinder, whichever is larger, independent of the others.

    Args:
        points: (n, 3) m, that were fitted.
        result: Of them.
        probe_sigma: m, standard deviation of one point along the wall's normal.
    """
    fitted = result.cylinder
    values = np.array([*fitted.centre, *fitted.slope, fitted.radius])
    columns = _free_columns(points, fitted.radius)
    jacobian = _radial(points, values)[1][:, columns]
    freedom = max(len(points) - len(columns), 1)
    scatter = max(float(np.sqrt(np.sum(result.form**2) / freedom)), probe_sigma)
    sigma = scatter * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    return sigma[:2], 2.0 * float(sigma[2])


def _free_columns(points: Array, radius: float) -> list[int]:
    """Columns of the derivative: centre, radius and, for points of enough height, the slopes."""
    return [0, 1, 4, 2, 3] if np.ptp(points[:, 2]) > _TALL * radius else [0, 1, 4]


def axis_distance(cylinder: HoleCylinder, points: Array) -> Array:
    """Returns the distance of points (n, 3) m from the axis, (n,) m."""
    values = np.array([*cylinder.centre, *cylinder.slope, 0.0])
    return _radial(points, values)[0]


def evaluate_hole(points: Array, *, centre: Array, radius: float) -> HoleResult:
    """Returns position and contour of a hole from points on its wall.

    Args:
        points: (n, 3) m in part coordinates, top face z = 0.
        centre: (2,) m, nominal.
        radius: m, nominal.

    Raises:
        ShapeError: Fewer than six points.
        ConvergenceError: No cylinder fits.
    """
    cylinder = fit_cylinder(points)
    distance = axis_distance(cylinder, points)
    offset = points[:, :2] - centre
    length = np.linalg.norm(offset, axis=1)
    return HoleResult(
        position_error=cylinder.centre - centre,
        cylinder=cylinder,
        contour=distance - radius,
        form=distance - cylinder.radius,
        angle=np.arctan2(offset[:, 1], offset[:, 0]),
        deviation=offset * ((length - radius) / length)[:, None],
    )


def _radial(points: Array, values: Array) -> tuple[Array, Array]:
    """Distance from the axis minus radius (n,), and its derivative (n, 5)."""
    direction = np.array([values[2], values[3], 1.0])
    length = np.linalg.norm(direction)
    unit = direction / length
    arm = points - np.array([values[0], values[1], 0.0])
    along = arm @ unit
    across = arm - along[:, None] * unit
    distance = np.linalg.norm(across, axis=1)
    outward = across / np.where(distance > 0.0, distance, 1.0)[:, None]
    jacobian = np.empty((len(points), 5))
    jacobian[:, :2] = -outward[:, :2]
    jacobian[:, 2:4] = -outward[:, :2] * (along / length)[:, None]
    jacobian[:, 4] = -1.0
    return distance - values[4], jacobian
