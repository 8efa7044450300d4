"""One frame from touches of every kind together: feature points, normals, surfaces.

A feature point is three planes through it, a normal one plane; Gauss-Newton on the distances, as in
:mod:`robotrue.cell.registration.surface_fit`, and graduated non-convexity over whole touches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import Noise, Registration
from robotrue.cell.registration.points import check_pattern
from robotrue.cell.registration.robust import check_majority
from robotrue.cell.registration.surface_fit import SurfaceTouches, linearised, solve_surfaces
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.graduated import GAUSS_NORMAL, GAUSS_POINT, agreeing
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet

FEWEST_ROBUST: Final = 4
"""Full points from which one wrong one can be told from the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _OwnPlanes:
    """One plane per touch; asked about exactly those touches, in their order.

    Attributes:
        point: (m, 3) m.
        normal: (m, 3) unit.
    """

    point: Array
    normal: Array

    def nearest(self, points: Array) -> tuple[Array, Array]:
        return np.einsum("ij,ij->i", points - self.point, self.normal), self.normal


@dataclass(frozen=True, slots=True, kw_only=True)
class Expanded:
    """Touches as distances from surfaces.

    Attributes:
        touches: m distances.
        owner: (m,) touch each belongs to.
    """

    touches: SurfaceTouches
    owner: IntArray


def expanded(touches: ProbingSet, in_base: Array) -> Expanded:
    """Returns the touches of one part as distances: three of a feature point, one of a normal.

    Args:
        touches: Of one part.
        in_base: (n, 3) m, where the tip was.
    """
    point, normal, planes = [], [], []
    for i, full in enumerate(touches.full):
        if touches.touched[i] != NO_SURFACE:
            continue
        for direction in np.eye(3) if full else touches.normal[i][None]:
            # The probe's radius is taken off every distance; a feature point knows none.
            point.append(touches.point[i] - (touches.radius * direction if full else 0.0))
            normal.append(direction)
            planes.append(i)
    own = _OwnPlanes(point=np.array(point), normal=np.array(normal))
    on_surface = np.flatnonzero(touches.touched != NO_SURFACE)
    owner = np.concatenate([np.array(planes, dtype=np.int64), on_surface])
    chosen = np.concatenate(
        [np.full(len(planes), len(touches.surfaces)), touches.touched[on_surface]]
    )
    return Expanded(
        touches=SurfaceTouches(
            surfaces=(*touches.surfaces, own),
            touched=chosen.astype(np.int64),
            centre=in_base[owner],
            radius=touches.radius,
        ),
        owner=owner,
    )


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
    parts = expanded(touches, base)
    n = len(touches)
    bound = np.where(touches.full, GAUSS_POINT, GAUSS_NORMAL) * noise.sigma
    latest = [_start(touches, base) if start is None else np.asarray(start, dtype=np.float64)]

    def length(weights: Array) -> Array:
        if touches.full.all():  # in closed form
            latest[0] = fit_rigid(touches.point, base, weights)
            gap = base - apply(latest[0], touches.point)
            return np.asarray(np.linalg.norm(gap, axis=1))
        latest[0] = solve_surfaces(parts.touches, latest[0], weights[parts.owner])
        distance = linearised(parts.touches, latest[0])[0]
        return np.asarray(np.sqrt(np.bincount(parts.owner, distance**2, minlength=n)))

    keep = _believed(touches, base, length, bound)
    off = length(keep.astype(np.float64))
    check_majority(keep, touches.labels, off, float(bound.max()))
    distance, normal, rows = linearised(parts.touches, latest[0])
    weights = keep[parts.owner].astype(np.float64)
    residuals = np.zeros((n, 3))
    np.add.at(residuals, parts.owner, distance[:, None] * normal)
    covariance = noise.sigma**2 * np.linalg.inv((rows * weights[:, None]).T @ rows)
    return Registration(
        method="touches",
        T_base_part=latest[0],
        covariance=0.5 * (covariance + covariance.T),
        names=touches.labels,
        residuals=residuals,
        outliers=tuple(name for name, good in zip(touches.labels, keep, strict=True) if not good),
        sigma=noise.sigma,
        sigma_source="stated",
        degrees_of_freedom=int(weights.sum()) - 6,
    )


def touch_gain(
    touches: ProbingSet, in_base: Array, T_base_part: Array, believed: Sequence[bool] | BoolArray
) -> Array:
    """Returns L (6, 3n): the frame's step (origin, left rotation vector) per error of the touches.

    The covariance of the frame is L C L^T for any joint covariance C of the touches in base.
    """
    parts = expanded(touches, np.asarray(in_base))
    _, normal, rows = linearised(parts.touches, T_base_part)
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


def _believed(
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
