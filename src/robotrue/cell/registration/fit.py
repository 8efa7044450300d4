"""Result type of all registrations, and the fit of feature points.

The point fit is weighted least squares (Kabsch 1976; Umeyama 1991, eq. 40-43) with its covariance
to first order. All points count equally or by their stated noise, unlike a frame built through
three of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import (
    apply,
    check_mirror,
    displacement_columns,
    fit_rigid,
    pose,
    propagate_covariance,
)
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError

FLAT: Final = 1e-3
"""Points closer to one line than this part of its length (rms) fix no rotation about it."""
UNIT_STEP: Final = 30.0
"""Patterns this many times larger or smaller than one another are in different units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Standard deviations per axis of a good touch from its fitted place.

    Attributes:
        touch: m, the touch itself: probe, surface, hand.
        robot: m, the error of the arm that is not a rigid motion of the whole part: about 0.3 to
            0.5 mm without a calibrated model, its stated position uncertainty with one.

    Both must be given: a bound without the robot's share rejects good points.
    """

    touch: float
    robot: float

    def __post_init__(self) -> None:
        """Checks the two numbers.

        Raises:
            ShapeError: A negative or infinite value, or both zero.
        """
        values = (self.touch, self.robot)
        if not all(0.0 <= v < np.inf for v in values) or sum(values) == 0.0:
            raise ShapeError(
                f"noise of {self.touch:g} m (touch) and {self.robot:g} m (robot), expected finite "
                "values of 0 or more, not both 0."
            )

    @property
    def sigma(self) -> float:
        """Both together, m per axis."""
        return float(np.hypot(self.touch, self.robot))


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration(Columns):
    """A part's frame in the robot base, found from touches.

    Attributes:
        method: Name of the fit.
        T_base_part: (4, 4) m.
        covariance: (6, 6) of the displacement of the part's origin (m) and its left rotation
            vector (rad), both in base axes.
        names: Name of each touch.
        residuals: (n, 3) m in base, touched minus predicted by the frame; along the surface normal
            alone where a touch fixes only that.
        outliers: Names rejected by the fit; their residuals are listed but not fitted.
        sigma: m per axis (per touch of a surface), the noise the covariance was scaled with.
        sigma_source: ``stated``, or ``residuals`` where nothing was stated.
        degrees_of_freedom: Equations of the accepted touches less six.
        least_squares: m^2, sum of squared residuals that least squares leave of the same touches;
            not given where the fit is least squares.
    """

    method: str
    T_base_part: Annotated[Array, Column("4 4", unit="m")]
    covariance: Annotated[Array, Column("6 6")]
    names: Annotated[tuple[str, ...], Column("n")]
    residuals: Annotated[Array, Column("n 3", unit="m")]
    outliers: tuple[str, ...] = ()
    sigma: float
    sigma_source: str
    degrees_of_freedom: int
    least_squares: float | None = None

    @property
    def distances(self) -> Array:
        """Length of each residual, (n,) m."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def believed(self) -> BoolArray:
        """(n,) True where the touch was fitted."""
        return np.array([name not in self.outliers for name in self.names])

    @property
    def rms(self) -> float:
        """Root mean square distance of the accepted touches, m."""
        return float(np.sqrt(np.mean(self.distances[self.believed] ** 2)))

    @property
    def misfit(self) -> float:
        """Residuals over stated noise: about 1 where it explains them; NaN with none to spare.

        Far above 1 the noise was stated too small, or the frame is a wrong one.
        """
        if self.degrees_of_freedom < 1:
            return float("nan")
        square = self.least_squares
        if square is None:
            square = float((self.distances[self.believed] ** 2).sum())
        return float(np.sqrt(square / self.degrees_of_freedom) / self.sigma)


def point_covariance(registration: Registration, points: Array) -> Array:
    """Returns the covariance (n, 3, 3) m^2, in base, of part points (n, 3) m.

    The frame's share alone. Touching and machining share the robot's own error, which is not in
    here: see the joint estimate for that.

    Args:
        registration: The frame.
        points: (n, 3) m in part.
    """
    lever = np.asarray(points) @ registration.T_base_part[:3, :3].T
    return propagate_covariance(registration.covariance, lever)


def displace_frame(T_base_part: Array, step: Array) -> Array:
    """Returns the frame displaced by a step (6,): origin (m), then left rotation vector (rad)."""
    turn = matrix_from_rotation_vector(step[3:])
    return pose(turn @ T_base_part[:3, :3], T_base_part[:3, 3] + step[:3])


def name_touches(names: tuple[str, ...] | None, n: int) -> tuple[str, ...]:
    """Returns the names given, or "1" to "n".

    Raises:
        ShapeError: Another number of names, or two alike.
    """
    found = tuple(str(i + 1) for i in range(n)) if names is None else tuple(names)
    if len(found) != n or len(set(found)) != n:
        raise ShapeError(f"{len(found)} names ({len(set(found))} different) for {n} touches.")
    return found


def point_residuals(T_base_part: Array, in_part: Array, in_base: Array) -> Array:
    """Returns touched minus predicted points (n, 3) m in base."""
    return np.asarray(in_base - apply(T_base_part, in_part))


def fit_points(
    in_part: Array,
    in_base: Array,
    *,
    sigma: npt.ArrayLike | None = None,
    noise: Array | None = None,
    names: tuple[str, ...] | None = None,
) -> Registration:
    """Returns the frame that best takes part points to touched points.

    Args:
        in_part: (n, 3) m, nominal points in part.
        in_base: (n, 3) m, touched points in base, in the same order.
        sigma: m per axis, one value or one per point; weights are 1/sigma^2. Not given: equal
            weights, and the covariance is scaled with the residuals.
        noise: (3n, 3n) m^2 in base, joint covariance of all touches, point by point. It changes the
            covariance of the frame, not the frame. The errors of a robot used as a probe are common
            to neighbouring points; ``sigma`` alone then is far too optimistic.
        names: One per point.

    Raises:
        ShapeError: Wrong shapes, a sigma of 0, or neither sigma nor residuals to estimate it from.
        ObservabilityError: Fewer than three points, or all on one line.
        ImplausibleDataError: Millimetres against metres, or a mirrored part.

    Fails when: two names of a nearly symmetric pattern are swapped (see ``check_names``), or a flat
    pattern is mirrored: it fits upside down.
    """
    in_part, in_base, labels = check_points(in_part, in_base, names)
    n = len(in_part)
    spread = np.ones(n) if sigma is None else np.broadcast_to(np.asarray(sigma, float), (n,))
    if not (np.isfinite(spread) & (spread > 0.0)).all():
        raise ShapeError(f"sigma of {spread.min():g} m, expected positive numbers.")
    weights = 1.0 / spread**2
    check_pattern(in_part, labels)
    T_base_part = fit_rigid(in_part, in_base, weights)
    residuals = point_residuals(T_base_part, in_part, in_base)
    check_mirror(in_part, in_base, weights)
    freedom = 3 * n - 6
    stated = sigma is not None or noise is not None
    scale = 1.0
    if not stated:
        scale = float(np.sqrt((residuals**2).sum() / freedom))
    gain = frame_gain(T_base_part, in_part, weights)
    if noise is None:
        joint = np.repeat((scale * spread) ** 2, 3)
        covariance = (gain * joint) @ gain.T
        typical = float(np.sqrt(np.mean(joint)))
    else:
        joint = frozen(noise, (3 * n, 3 * n), "noise")
        covariance = gain @ joint @ gain.T
        typical = float(np.sqrt(np.trace(joint) / (3 * n)))
    return Registration(
        method="points",
        T_base_part=T_base_part,
        covariance=0.5 * (covariance + covariance.T),
        names=labels,
        residuals=residuals,
        sigma=typical,
        sigma_source="stated" if stated else "residuals",
        degrees_of_freedom=freedom,
    )


def frame_gain(T_base_part: Array, in_part: Array, weights: Array | None = None) -> Array:
    """Returns L (6, 3n): the frame's step (origin, left rotation vector) per error of the touches.

    The covariance of the frame is L C L^T for any joint covariance C of the touches; with the
    robot's J S J^T in it the frame carries the error of the probing postures.

    Args:
        T_base_part: (4, 4) the frame.
        in_part: (n, 3) m in part.
        weights: (n,); equal if not given.
    """
    lever = in_part @ T_base_part[:3, :3].T
    n = len(lever)
    jacobian = displacement_columns(lever)
    w = np.ones(n) if weights is None else weights / weights.mean()
    weighted = np.swapaxes(jacobian * w[:, None, None], -1, -2)
    normal = np.einsum("nij,njk->ik", weighted, jacobian)
    return np.asarray(np.linalg.solve(normal, np.concatenate(list(weighted), axis=1)))


def check_points(
    in_part: Array, in_base: Array, names: tuple[str, ...] | None
) -> tuple[Array, Array, tuple[str, ...]]:
    """Returns both sets of points (n, 3), frozen, and their names.

    Raises:
        ShapeError: Wrong shapes or names.
        ImplausibleDataError: Sets of sizes that differ as millimetres and metres do.
    """
    part: Array = frozen(in_part, (None, 3), "in_part")
    base: Array = frozen(in_base, (len(part), 3), "in_base")
    sizes = [float(np.ptp(p, axis=0).max()) if len(p) else 0.0 for p in (part, base)]
    if min(sizes) > 0.0 and not 1.0 / UNIT_STEP < sizes[1] / sizes[0] < UNIT_STEP:
        raise ImplausibleDataError(
            f"the part points span {sizes[0]:g} m and the touched points {sizes[1]:g} m.",
            hint="one of the two is probably in millimetres; multiply it by 0.001.",
        )
    return part, base, name_touches(names, len(part))


def check_pattern(points: Array, names: tuple[str, ...]) -> None:
    """Passes if the points fix all six directions.

    Args:
        points: (n, 3) m.
        names: Of the points.

    Raises:
        ObservabilityError: Fewer than three different points, or all on one line; names them.
    """
    listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    if len(points) < 3:
        raise ObservabilityError(
            f"{len(points)} points ({listed}), a frame needs 3 or more that are not on one line.",
            hint="touch more feature points.",
        )
    centred = points - points.mean(axis=0)
    _, size, axes = np.linalg.svd(centred, full_matrices=False)
    size = size / np.sqrt(len(points))
    if size[0] <= np.finfo(float).eps * np.abs(points).max():
        raise ObservabilityError(
            f"points {listed} coincide: they spread by {size[0] / MM:.3g} mm.",
            hint="probe points that are far apart.",
        )
    if size[1] <= FLAT * size[0]:
        axis = ", ".join(f"{v:+.2f}" for v in axes[0])
        raise ObservabilityError(
            f"points {listed} lie on one line along ({axis}): {size[1] / MM:.3g} mm off it, rms, "
            f"over {size[0] / MM:.3g} mm along it; the rotation about it is not observable.",
            hint="touch a point to the side of that line.",
        )
