"""Point fit: weighted least squares of touched feature points (Kabsch), with its covariance.

All points count equally or by their stated noise, unlike a frame built through three of them.
Sources: Kabsch 1976; Umeyama 1991, eq. 40-43. Covariance to first order.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.cell.registration.fit import Registration, name_touches, point_residuals
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import displacement_columns, fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError

FLAT: Final = 1e-3
"""Points closer to one line than this part of its length (rms) fix no rotation about it."""
UNIT_STEP: Final = 30.0
"""Patterns this many times larger or smaller than one another are in different units."""


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
            weights, and the covariance is scaled with what the residuals say.
        noise: (3n, 3n) m^2 in base, joint covariance of all touches, point by point. It changes
            the covariance of the frame, not the frame. The errors of a robot used as a probe are
            common to neighbouring points; ``sigma`` alone then promises far too much.
        names: One per point.

    Raises:
        ShapeError: Wrong shapes, a sigma of 0, or neither sigma nor a residual left to tell.
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
    _check_mirror(in_part, in_base, weights, residuals)
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


def check_pattern(points: Array, names: tuple[str, ...], *, floor: float = 0.0) -> None:
    """Passes if the points fix all six directions.

    Args:
        points: (n, 3) m.
        names: Of the points.
        floor: m; points nearer to one line than this, rms, count as on it.

    Raises:
        ObservabilityError: Fewer than three different points, or all on one line; says which.
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
    if size[0] <= max(floor, np.finfo(float).eps * np.abs(points).max()):
        raise ObservabilityError(
            f"points {listed} coincide: they spread by {size[0] / MM:.3g} mm.",
            hint="touch points that are far apart.",
        )
    if size[1] <= max(FLAT * size[0], floor):
        axis = ", ".join(f"{v:+.2f}" for v in axes[0])
        raise ObservabilityError(
            f"points {listed} lie on one line along ({axis}): {size[1] / MM:.3g} mm off it, rms, "
            f"over {size[0] / MM:.3g} mm along it; the rotation about it is not observable.",
            hint="touch a point to the side of that line.",
        )


def _check_mirror(in_part: Array, in_base: Array, weights: Array, residuals: Array) -> None:
    """A pattern with depth that fits far better as its mirror image is a mirrored part."""
    here = float(np.sqrt(weights @ (residuals**2).sum(axis=1)))
    mirrored = in_part * np.array([1.0, 1.0, -1.0])
    other = point_residuals(fit_rigid(mirrored, in_base, weights), mirrored, in_base)
    there = float(np.sqrt(weights @ (other**2).sum(axis=1)))
    size = float(np.sqrt(weights @ ((in_part - in_part.mean(axis=0)) ** 2).sum(axis=1)))
    if here > 1e-2 * size and there < 0.1 * here:
        left = np.sqrt(np.mean((residuals**2).sum(axis=1))) / MM
        raise ImplausibleDataError(
            f"the touched points are the mirror image of the part: {left:.3g} mm rms are left, "
            f"{left * there / here:.3g} mm with one axis of the part reversed.",
            hint="check the sign of one coordinate, or the order of the names.",
        )
