"""One frame from touches of every kind together: feature points, normals, surfaces.

A feature point is three planes through it, a normal one plane; Gauss-Newton on the distances, as in
:mod:`robotrue.cell.registration.surface_distances`, and graduated non-convexity over whole touches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import Noise, Registration, check_pattern
from robotrue.cell.registration.surface_distances import (
    SurfaceDistances,
    linearise_distances,
    list_distances,
    solve_frame,
)
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.graduated import GAUSS_NORMAL, GAUSS_POINT, agreeing
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import ProbingSet

FEWEST_ROBUST: Final = 4
"""Full points from which one wrong one can be told from the rest."""


def fit_touches(
    touches: ProbingSet, in_base: Array, *, noise: Noise, start: Array | None = None
) -> Registration:
    """Returns the frame of one part that best explains all its touches, and names wrong ones.

    Args:
        touches: Of one part.
        in_base: (n, 3) m, where the tip was.
        noise: Of touch and robot; feature points within 3.4 sigma and normals within 2.6 belong.
        start: (4, 4) roughly ``T_base_part``; not given: the rigid fit of the nominal points.

    Raises:
        ObservabilityError: The touches leave a motion free.
        ImplausibleDataError: Half of them disagree, or the part is mirrored.
        ConvergenceError: No rest.
    """
    base: Array = frozen(in_base, (len(touches), 3), "in_base")
    parts = list_distances(touches, base)
    n = len(touches)
    bound = np.where(touches.full, GAUSS_POINT, GAUSS_NORMAL) * noise.sigma
    latest = [_start(touches, base) if start is None else np.asarray(start, dtype=np.float64)]

    def length(weights: Array) -> Array:
        if touches.full.all():  # in closed form
            latest[0] = fit_rigid(touches.point, base, weights)
            gap = base - apply(latest[0], touches.point)
            return np.asarray(np.linalg.norm(gap, axis=1))
        latest[0] = solve_frame(parts, latest[0], weights[parts.owner])
        distance = linearise_distances(parts, latest[0])[0]
        return np.asarray(np.sqrt(np.bincount(parts.owner, distance**2, minlength=n)))

    keep = _choose_touches(touches, base, length, bound)
    off = length(keep.astype(np.float64))
    _check_majority(keep, touches.labels, off, float(bound.max()))
    return _registration(touches, parts, latest[0], keep, sigma=noise.sigma)


def fit_all_touches(
    touches: ProbingSet, in_base: Array, *, sigma: float | None = None, start: Array | None = None
) -> Registration:
    """Returns the frame that least squares make of all touches, none of them doubted.

    Args:
        touches: Of one part; on surfaces alone six or more that together fix all directions.
        in_base: (n, 3) m, where the tip was.
        sigma: m along the normal; not given: from the residuals (one equation to spare or more).
        start: (4, 4) roughly ``T_base_part``; not given: the rigid fit of the nominal points.
            Planes forgive tens of degrees; a mesh about 25 deg and 50 mm with 30 touches or more.

    Raises:
        ObservabilityError: Touches that leave a motion free, or nearly so; says which.
        ConvergenceError: No rest after many steps.
        ShapeError: Neither a sigma nor residuals to tell it from.

    Fails when: the part looks the same from another side (see ``symmetric_alternatives``), or the
    start on a mesh is too far: the fit then rests in a wrong place, with a ``misfit`` far above 1.
    """
    base: Array = frozen(in_base, (len(touches), 3), "in_base")
    parts = list_distances(touches, base)
    if sigma is None and len(parts.owner) < 7:
        raise ShapeError(
            f"{len(touches)} touches leave no residual to tell the noise from; sigma in m "
            "is needed, or 7 touches or more."
        )
    begin = _start(touches, base) if start is None else np.asarray(start, dtype=np.float64)
    T_base_part = solve_frame(parts, begin, np.ones(len(parts.owner)))
    return _registration(touches, parts, T_base_part, np.ones(len(touches), bool), sigma=sigma)


def _registration(
    touches: ProbingSet,
    parts: SurfaceDistances,
    T_base_part: Array,
    keep: BoolArray,
    *,
    sigma: float | None,
) -> Registration:
    """The frame with the covariance of the touches kept, scaled with their residuals or a sigma."""
    distance, normal, rows = linearise_distances(parts, T_base_part)
    weights = keep[parts.owner].astype(np.float64)
    residuals = np.zeros((len(touches), 3))
    np.add.at(residuals, parts.owner, distance[:, None] * normal)
    freedom = int(weights.sum()) - 6
    scale = float(np.sqrt(weights @ distance**2 / freedom)) if sigma is None else sigma
    covariance = scale**2 * np.linalg.inv((rows * weights[:, None]).T @ rows)
    return Registration(
        method="touches",
        T_base_part=T_base_part,
        covariance=0.5 * (covariance + covariance.T),
        names=touches.labels,
        residuals=residuals,
        outliers=tuple(name for name, good in zip(touches.labels, keep, strict=True) if not good),
        sigma=scale,
        sigma_source="residuals" if sigma is None else "stated",
        degrees_of_freedom=freedom,
    )


def touch_gain(
    touches: ProbingSet, in_base: Array, T_base_part: Array, believed: Sequence[bool] | BoolArray
) -> Array:
    """Returns L (6, 3n): the frame's step (origin, left rotation vector) per error of the touches.

    The covariance of the frame is L C L^T for any joint covariance C of the touches in base.
    """
    parts = list_distances(touches, np.asarray(in_base))
    _, normal, rows = linearise_distances(parts, T_base_part)
    weights = np.asarray(believed, dtype=np.float64)[parts.owner]
    each = np.linalg.solve((rows * weights[:, None]).T @ rows, (rows * weights[:, None]).T)
    out = np.zeros((len(touches), 6, 3))
    np.add.at(out, parts.owner, each.T[:, :, None] * normal[:, None, :])
    return np.asarray(np.concatenate(list(out), axis=1))


def _start(touches: ProbingSet, base: Array) -> Array:
    """Rigid fit of the feature points where they fix a frame, else of all nominal points."""
    full = touches.full
    rows = full if int(full.sum()) >= 3 and _spread_out(touches.point[full]) else full | True
    names = tuple(n for n, mine in zip(touches.labels, rows, strict=True) if mine)
    check_pattern(touches.point[rows], names)
    return fit_rigid(touches.point[rows], base[rows])


def _spread_out(points: Array) -> bool:
    try:
        check_pattern(points, tuple(str(i) for i in range(len(points))))
    except ObservabilityError:
        return False
    return True


def _choose_touches(
    touches: ProbingSet, base: Array, length: Callable[[Array], Array], bound: Array
) -> BoolArray:
    """Returns which touches agree.

    Raises:
        ImplausibleDataError: They contradict each other and are too few to say which is wrong.
    """
    n = len(touches)
    everything = length(np.ones(n))
    if (everything <= bound).all():
        return np.ones(n, dtype=bool)
    spare = 3 * int(touches.full.sum()) + int((~touches.full).sum()) - 6
    try:
        if (touches.full.all() and n < FEWEST_ROBUST) or spare < 2:
            raise ObservabilityError("nothing to spare")
        return agreeing(lambda w: length(w) / bound, n, 1.0)
    except ObservabilityError:
        told = ", ".join(
            f"{name} ({d / MM:.2f} mm)" for name, d in zip(touches.labels, everything, strict=True)
        )
        raise ImplausibleDataError(
            f"{n} touches contradict each other by more than {bound.max() / MM:.2f} mm and are "
            f"too few to say which is wrong: {told}.",
            hint="touch them again, and one or two more; check names and units.",
        ) from None


def _check_majority(keep: BoolArray, names: tuple[str, ...], distance: Array, bound: float) -> None:
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
