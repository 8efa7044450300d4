"""Fits that survive wrong touches: graduated non-convexity with truncated least squares.

Yang, Antonante, Tzoumas, Carlone 2020, "Graduated non-convexity for robust spatial perception",
eq. 14-16 (the truncated least squares surrogate, its start and its weights). Deterministic: the
first pass is an ordinary fit, every further one follows from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import (
    GAUSS_NORMAL,
    GAUSS_POINT,
    Noise,
    Registration,
    point_residuals,
)
from robotrue.cell.registration.points import check_pattern, checked_points, fit_points
from robotrue.cell.registration.surface_fit import (
    SurfaceTouches,
    fit_surfaces,
    linearised,
    solve_surfaces,
)
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError, ImplausibleDataError

FASTER: Final = 1.4
"""Factor of the control parameter from pass to pass."""
PASSES: Final = 200


def fit_points_robust(
    in_part: Array,
    in_base: Array,
    *,
    noise: Noise,
    names: tuple[str, ...] | None = None,
) -> Registration:
    """Returns the point fit of the touches that agree, and the names of those that do not.

    Args:
        in_part: (n, 3) m in part.
        in_base: (n, 3) m in base, touched.
        noise: Of touch and robot; residuals within 3.4 sigma belong.
        names: One per point.

    Raises:
        ImplausibleDataError: Half the points or more disagree; then nothing says which half.
        ObservabilityError: The points, or those that agree, fix no frame.

    Fails when: fewer than two points more than a frame needs agree; wrong ones can then agree by
    chance.
    """
    part, base, labels = checked_points(in_part, in_base, names)
    check_pattern(part, labels)

    def residual(weights: Array) -> Array:
        T = fit_rigid(part, base, weights)
        return np.asarray(np.linalg.norm(point_residuals(T, part, base), axis=1))

    keep = agreeing(residual, len(part), GAUSS_POINT * noise.sigma)
    _check_majority(keep, labels, residual(keep.astype(float)), GAUSS_POINT * noise.sigma)
    kept = tuple(name for name, good in zip(labels, keep, strict=True) if good)
    fit = fit_points(part[keep], base[keep], sigma=noise.sigma, names=kept)
    return replace(
        fit,
        method="points-robust",
        names=labels,
        residuals=point_residuals(fit.T_base_part, part, base),
        outliers=tuple(name for name, good in zip(labels, keep, strict=True) if not good),
    )


def fit_surfaces_robust(touches: SurfaceTouches, start: Array, *, noise: Noise) -> Registration:
    """Returns the surface fit of the touches that agree, and the names of those that do not.

    Args:
        touches: On the part's surfaces.
        start: (4, 4) roughly ``T_base_part``.
        noise: Of touch and robot; distances within 2.6 sigma belong.

    Raises:
        ImplausibleDataError: Half the touches or more disagree.
        ObservabilityError: The touches, or those that agree, leave a motion free.
        ConvergenceError: No rest.
    """
    bound = GAUSS_NORMAL * noise.sigma
    latest = [np.asarray(start, dtype=np.float64)]

    def residual(weights: Array) -> Array:
        latest[0] = solve_surfaces(touches, latest[0], weights)
        return np.asarray(np.abs(linearised(touches, latest[0])[0]))

    keep = agreeing(residual, len(touches.centre), bound)
    _check_majority(keep, touches.names, np.abs(linearised(touches, latest[0])[0]), bound)
    return fit_surfaces(
        touches,
        latest[0],
        sigma=noise.sigma,
        weights=keep.astype(float),
        method="surfaces-robust",
    )


def agreeing(residual: Callable[[Array], Array], n: int, bound: float) -> BoolArray:
    """Returns which of n touches (n,) agree: the larger of two sets found in different ways.

    Graduated non-convexity, and dropping the worst touch until all fit; then every touch that lies
    within the bound of a set's own fit belongs to it. Few touches with many wrong ones make either
    way fail now and then, seldom both.

    Args:
        residual: From weights (n,) to residual lengths (n,) m after the weighted fit.
        n: How many.
        bound: m; longer residuals count as wrong.

    Raises:
        ConvergenceError: See ``graduated``.
    """
    first = _grown(residual, graduated(residual, n, bound) > 0.5, bound)
    if first.all():
        return first
    second = _grown(residual, _dropped(residual, n, bound), bound)
    return second if int(second.sum()) > int(first.sum()) else first


def _dropped(residual: Callable[[Array], Array], n: int, bound: float) -> BoolArray:
    keep = np.ones(n, dtype=bool)
    while 2 * int(keep.sum()) > n:
        length = np.where(keep, residual(keep.astype(float)), 0.0)
        worst = int(np.argmax(length))
        if length[worst] <= bound:
            break
        keep[worst] = False
    return keep


def _grown(residual: Callable[[Array], Array], keep: BoolArray, bound: float) -> BoolArray:
    """Returns the set that its own fit confirms; the one given if it never comes to rest."""
    now = keep
    for _ in range(10):
        if 2 * int(now.sum()) <= len(now):
            return keep
        new: BoolArray = residual(now.astype(float)) <= bound
        if (new == now).all():
            return now
        now = new
    return keep


def graduated(residual: Callable[[Array], Array], n: int, bound: float) -> Array:
    """Returns weights (n,), each 0 or 1, of truncated least squares.

    Args:
        residual: From weights (n,) to residual lengths (n,) m after the weighted fit.
        n: How many.
        bound: m; longer residuals count as wrong.

    Raises:
        ConvergenceError: Weights between 0 and 1 after many passes.
    """
    weights = np.ones(n)
    squared = residual(weights) ** 2
    limit = bound**2
    largest = float(squared.max())
    if largest <= limit:
        return weights
    mu = limit / (2.0 * largest - limit)
    for _ in range(PASSES):
        low, high = mu / (mu + 1.0) * limit, (mu + 1.0) / mu * limit
        safe = np.maximum(squared, np.finfo(float).tiny)
        weights = np.clip(np.sqrt(limit * mu * (mu + 1.0) / safe) - mu, 0.0, 1.0)
        weights = np.where(squared <= low, 1.0, np.where(squared >= high, 0.0, weights))
        if not ((weights > 0.0) & (weights < 1.0)).any():
            return weights
        squared = residual(weights) ** 2
        mu *= FASTER
    raise ConvergenceError(
        f"{int(((weights > 0) & (weights < 1)).sum())} of {n} touches are neither right nor wrong "
        f"after {PASSES} passes at a bound of {bound / MM:.3g} mm.",
        hint="state the noise anew; the bound cuts through the good touches.",
    )


def _check_majority(keep: BoolArray, names: tuple[str, ...], distance: Array, bound: float) -> None:
    if 2 * int(keep.sum()) > len(keep):
        return
    wrong = ", ".join(
        f"{name} ({d / MM:.2f} mm)"
        for name, d, good in zip(names, distance, keep, strict=True)
        if not good
    )
    raise ImplausibleDataError(
        f"{len(keep) - int(keep.sum())} of {len(keep)} touches disagree with the rest by more than "
        f"{bound / MM:.2f} mm: {wrong}.",
        hint="check the names and units of the touches; the stated noise must include the "
        "robot's own error.",
    )
