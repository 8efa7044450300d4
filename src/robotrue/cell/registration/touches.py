"""One frame from touches of every kind together: feature points, normals, surfaces.

A feature point is three planes through it, a normal one plane. The frame makes the distances of the
touches from their surfaces least, by Gauss-Newton and graduated non-convexity over whole touches.
On a mesh it is point-to-plane ICP (Chen and Medioni 1992): the nearest facet is searched again in
every step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import Noise, Registration, check_pattern, displace_frame
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.observable import check_motions
from robotrue.core.poses import apply, fit_rigid, inverse
from robotrue.core.robust import GAUSS_NORMAL, GAUSS_POINT, agreeing
from robotrue.core.surfaces import Surface
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError, ImplausibleDataError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet

STEPS: Final = 200
_STILL: Final = 1e-9
"""m at the size of the pattern: a smaller step is none."""
_GAIN: Final = 1e-9
"""A step that lowers the squared distances by less than this part of them is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _OwnPlanes:
    """One plane per touch; valid for exactly those touches, in their order.

    Attributes:
        point: (m, 3) m.
        normal: (m, 3) unit.
    """

    point: Array
    normal: Array

    def nearest(self, points: Array) -> tuple[Array, Array]:
        return np.einsum("ij,ij->i", points - self.point, self.normal), self.normal


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceDistances:
    """m distances of probe centres from the surfaces they touched.

    Attributes:
        surfaces: In part.
        touched: (m,) index of the surface of each.
        centre: (m, 3) m in base, of the probe's ball (or the point itself with radius 0).
        radius: m, of the ball.
        owner: (m,) touch each belongs to.
    """

    surfaces: tuple[Surface, ...]
    touched: IntArray
    centre: Array
    radius: float
    owner: IntArray


def list_distances(touches: ProbingSet, in_base: Array) -> SurfaceDistances:
    """Returns the touches of one part as distances: three of a feature point, one of a normal.

    Args:
        touches: Of one part.
        in_base: (n, 3) m, positions of the tip.
    """
    point, normal, planes = [], [], []
    for i, full in enumerate(touches.full):
        if touches.touched[i] != NO_SURFACE:
            continue
        for direction in np.eye(3) if full else touches.normal[i][None]:
            # The probe's radius is subtracted from every distance; a feature point has none.
            point.append(touches.point[i] - (touches.radius * direction if full else 0.0))
            normal.append(direction)
            planes.append(i)
    own = (_OwnPlanes(point=np.array(point), normal=np.array(normal)),) if planes else ()
    on_surface = np.flatnonzero(touches.touched != NO_SURFACE)
    owner = np.concatenate([np.array(planes, dtype=np.int64), on_surface])
    chosen = [np.full(len(planes), len(touches.surfaces)), touches.touched[on_surface]]
    return SurfaceDistances(
        surfaces=(*touches.surfaces, *own),
        touched=np.concatenate(chosen).astype(np.int64),
        centre=in_base[owner],
        radius=touches.radius,
        owner=owner,
    )


def linearise_distances(
    touches: SurfaceDistances, T_base_part: Array
) -> tuple[Array, Array, Array]:
    """Returns distances (m,) m less the radius, normals (m, 3) in base, and rows (m, 6).

    A row times a step of the frame (origin in m, left rotation vector) is the decrease of the
    distance: [normal, (q - origin) x normal].
    """
    in_part = apply(inverse(T_base_part), touches.centre)
    distance = np.empty(len(in_part))
    normal = np.empty((len(in_part), 3))
    for index, surface in enumerate(touches.surfaces):
        mine = touches.touched == index
        if mine.any():
            distance[mine], normal[mine] = surface.nearest(in_part[mine])
    normal = normal @ T_base_part[:3, :3].T
    lever = touches.centre - T_base_part[:3, 3]
    return distance - touches.radius, normal, np.hstack([normal, np.cross(lever, normal)])


def solve_frame(touches: SurfaceDistances, start: Array, weights: Array) -> Array:
    """Returns the frame (4, 4) of least weighted squared distance, from a start.

    Raises:
        ObservabilityError: Too few touches, or a motion the surfaces leave free.
        ConvergenceError: No convergence after many steps.
    """
    T: Array = np.array(start, dtype=np.float64)
    root = np.sqrt(weights)
    size = float(np.ptp(touches.centre, axis=0).max()) if len(weights) else 0.0
    scale = np.array([1.0, 1.0, 1.0, size, size, size])
    distance, normal, _ = linearise_distances(touches, T)
    used = weights > 0.0
    if int(used.sum()) < 6:
        raise ObservabilityError(
            f"{int(used.sum())} touches on surfaces, a frame needs 6 or more: each fixes one "
            "direction.",
            hint="3 on the largest face, 2 on the next, 1 on the third is the least.",
        )
    cost = float(weights @ distance**2)
    length = np.inf
    for _ in range(STEPS):
        # Columns in metres at the pattern's size: the cut-off of lstsq then has one meaning.
        origin = np.hstack([normal, np.cross(touches.centre - touches.centre.mean(0), normal)])
        scaled = origin * root[:, None] / scale
        twist = np.linalg.lstsq(scaled, root * distance, rcond=1e-6)[0] / scale
        twist[:3] += np.cross(twist[3:], T[:3, 3] - touches.centre.mean(0))
        for shorter in (1.0, 0.5, 0.25, 0.1, 0.01):
            new = displace_frame(T, shorter * twist)
            found = linearise_distances(touches, new)
            new_cost = float(weights @ found[0] ** 2)
            if new_cost <= cost:
                break
        else:
            # No step helps: at rest on an edge between facets, or at the rounding.
            check_motions(touches.centre[used], normal[used], T)
            return T
        length = float(np.linalg.norm(shorter * twist * scale))
        gained = cost - new_cost
        T, (distance, normal, _), cost = new, found, new_cost
        if length < _STILL or gained <= _GAIN * cost:
            check_motions(touches.centre[used], normal[used], T)
            return T
    raise ConvergenceError(
        f"the surface fit still moves by {length * 1e3:.3g} mm after {STEPS} steps; "
        f"{np.sqrt(cost / weights.sum()) * 1e3:.3g} mm rms residual.",
        hint="start nearer to the part's pose, or touch more points.",
    )


FEWEST_ROBUST: Final = 4
"""Fewest full points from which a wrong one can be identified."""


def fit_touches(
    touches: ProbingSet, in_base: Array, *, noise: Noise, start: Array | None = None
) -> Registration:
    """Returns the frame of one part that best explains all its touches, and names wrong ones.

    Args:
        touches: Of one part.
        in_base: (n, 3) m, positions of the tip.
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
    """Returns the least-squares frame of all touches, without outlier rejection.

    Args:
        touches: Of one part; on surfaces alone six or more that together fix all directions.
        in_base: (n, 3) m, positions of the tip.
        sigma: m along the normal; not given: from the residuals (one equation to spare or more).
        start: (4, 4) roughly ``T_base_part``; not given: the rigid fit of the nominal points.
            Planes allow tens of degrees; a mesh about 25 deg and 50 mm with 30 touches or more.

    Raises:
        ObservabilityError: Touches that leave a motion free, or nearly so; states it.
        ConvergenceError: No convergence after many steps.
        ShapeError: Neither a sigma nor residuals to estimate it from.

    Fails when: the part looks the same from another side (see ``symmetric_alternatives``), or the
    start on a mesh is too far: the fit then rests in a wrong place, with a ``misfit`` far above 1.
    """
    base: Array = frozen(in_base, (len(touches), 3), "in_base")
    parts = list_distances(touches, base)
    if sigma is None and len(parts.owner) < 7:
        raise ShapeError(
            f"{len(touches)} touches leave no residual to estimate the noise; sigma in m "
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
    """Returns the frame with its covariance from the accepted touches, scaled by residuals."""
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
        ImplausibleDataError: They contradict each other and are too few to identify the wrong ones.
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
            f"too few to find the wrong one: {told}.",
            hint="touch them again, and one or two more; check names and units.",
        ) from None


def _check_majority(keep: BoolArray, names: tuple[str, ...], distance: Array, bound: float) -> None:
    """Passes if more than half of the touches agree.

    Raises:
        ImplausibleDataError: They do not; names those that disagree, and their distances.
    """
    if 2 * int(keep.sum()) > len(keep):
        return
    wrong = ", ".join(
        f"{name} ({d / MM:.2f} mm)"
        for name, d, good in zip(names, distance, keep, strict=True)
        if not good
    )
    raise ImplausibleDataError(
        f"{len(keep) - int(keep.sum())} of {len(keep)} touches disagree with the others by more "
        f"than {bound / MM:.2f} mm: {wrong}.",
        hint="check names and units of the touches, and whether the tool is the one stated; the "
        "stated noise must include the robot's own error.",
    )
