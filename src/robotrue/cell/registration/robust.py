"""Fits that survive wrong touches, by graduated non-convexity (:mod:`robotrue.core.graduated`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.cell.registration.fit import (
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
from robotrue.core.graduated import GAUSS_NORMAL, GAUSS_POINT, agreeing
from robotrue.core.poses import fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError


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
    check_majority(keep, labels, residual(keep.astype(float)), GAUSS_POINT * noise.sigma)
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
    check_majority(keep, touches.names, np.abs(linearised(touches, latest[0])[0]), bound)
    return fit_surfaces(
        touches,
        latest[0],
        sigma=noise.sigma,
        weights=keep.astype(float),
        method="surfaces-robust",
    )


def check_majority(keep: BoolArray, names: tuple[str, ...], distance: Array, bound: float) -> None:
    """Passes if more than half of the touches agree.

    Raises:
        ImplausibleDataError: They do not; names those that disagree, and by how much.
    """
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
        hint="check names and units of the touches, and whether the tool is the one stated; the "
        "stated noise must include the robot's own error.",
    )
