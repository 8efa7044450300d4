"""Touches that fit more than one way: swapped names of points, and poses that look alike.

:func:`check_names` matches touched points to part points; :func:`symmetric_alternatives` finds
other poses of a part that fit its surface touches equally well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import check_pattern, check_points
from robotrue.cell.registration.touches import (
    SurfaceDistances,
    linearise_distances,
    list_distances,
    solve_frame,
)
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.poses import apply, fit_rigid, inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.surfaces import Cylinder, TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConvergenceError, ImplausibleDataError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import ProbingSet

MOST: Final = 60
"""Points a search over triples is made for."""


def check_names(
    in_part: Array,
    in_base: Array,
    *,
    tolerance: float,
    names: tuple[str, ...] | None = None,
) -> tuple[str, ...]:
    """Returns warnings about the names, one sentence each; swapped names raise.

    Args:
        in_part: (n, 3) m in part.
        in_base: (n, 3) m in base, in the order of the names.
        tolerance: m, largest error of a good touch: about four sigma of touch and robot together.
        names: One per point.

    Raises:
        ImplausibleDataError: The touches fit under other names and not under these.
        ObservabilityError: Coincident or collinear points.
        ShapeError: More points than a search is made for.

    Fails when: a touch is grossly wrong; no complete match then exists and there is no warning. A
    robust fit names it.
    """
    part, base, labels = check_points(in_part, in_base, names)
    given = apply(fit_rigid(part, base), part) - base
    found = matches(part, base, tolerance=tolerance)
    identity = np.arange(len(part))
    if np.linalg.norm(given, axis=1).max() > tolerance and found:
        order = found[0]
        moved = [f"{labels[i]} is {labels[order[i]]}" for i in np.flatnonzero(order != identity)]
        raise ImplausibleDataError(
            f"the touches fit within {tolerance / MM:.2f} mm if names are exchanged "
            f"({', '.join(moved[:6])}{', ...' if len(moved) > 6 else ''}) and are "
            f"{np.linalg.norm(given, axis=1).max() / MM:.2f} mm off as named.",
            hint="correct the names of the touches.",
        )
    others = [order for order in found if (order != identity).any()]
    if not others:
        return ()
    example = ", ".join(f"{labels[i]} for {labels[others[0][i]]}" for i in range(len(labels)))
    return (
        f"The pattern fits {len(others) + 1} ways within {tolerance / MM:.2f} mm (for example "
        f"{example}); only the names decide. Probe one point that breaks the symmetry.",
    )


def matches(points: Array, others: Array, *, tolerance: float) -> tuple[IntArray, ...]:
    """Returns every order in which the others are a rigid image of the points, best first.

    In an order o, ``others[o[i]]`` is the image of ``points[i]``.

    Args:
        points: (n, 3) m.
        others: (n, 3) m, in any frame.
        tolerance: m, of every single point.

    Raises:
        ObservabilityError: Coincident or collinear points.
        ShapeError: Different numbers, or more points than a search is made for.
    """
    n = len(points)
    if len(others) != n or n > MOST:
        raise ShapeError(f"{n} and {len(others)} points, expected equal numbers up to {MOST}.")
    check_pattern(points, tuple(str(i + 1) for i in range(n)))
    triple = _wide_triple(points)
    sides = [float(np.linalg.norm(points[triple[i]] - points[triple[i - 1]])) for i in range(3)]
    apart = np.linalg.norm(others[:, None] - others[None, :], axis=2)
    fits = [np.abs(apart - side) <= 2.0 * tolerance for side in sides]
    # sides[1] joins the first two, sides[2] the last two, sides[0] the first and the last.
    i, j, k = np.nonzero(fits[1][:, :, None] & fits[2][None, :, :] & fits[0][:, None, :])
    found: dict[tuple[int, ...], float] = {}
    for image in zip(i.tolist(), j.tolist(), k.tolist(), strict=True):
        if len(set(image)) < 3:
            continue
        order = _complete_order(points, others, triple, image, tolerance)
        if order is not None and tuple(order) not in found:
            left = apply(fit_rigid(points, others[order]), points) - others[order]
            if np.linalg.norm(left, axis=1).max() <= tolerance:
                found[tuple(int(o) for o in order)] = float((left**2).sum())
    ranked = sorted(found, key=lambda order: found[order])
    return tuple(np.array(order, dtype=np.int64) for order in ranked)


def _wide_triple(points: Array) -> list[int]:
    middle = points.mean(axis=0)
    first = int(np.argmax(np.linalg.norm(points - middle, axis=1)))
    second = int(np.argmax(np.linalg.norm(points - points[first], axis=1)))
    across = np.cross(points - points[first], points[second] - points[first])
    return [first, second, int(np.argmax(np.linalg.norm(across, axis=1)))]


def _complete_order(
    points: Array, others: Array, triple: list[int], image: Sequence[int], tolerance: float
) -> IntArray | None:
    """Returns the whole order a triple's image implies, or None if it is not one to one."""
    T = fit_rigid(points[triple], others[list(image)])
    apart = np.linalg.norm(apply(T, points)[:, None] - others[None, :], axis=2)
    order = np.argmin(apart, axis=1)
    # Three points carry their errors to the far end of the pattern, hence the wider gate here.
    if len(set(order.tolist())) < len(order) or apart.min(axis=1).max() > 4.0 * tolerance:
        return None
    return np.asarray(order, dtype=np.int64)


TURNS: Final = (90.0 * DEG, 180.0 * DEG, 270.0 * DEG)
LEFT: Final = 1.5
"""An alternative may leave this many times the larger of sigma and the fit's own rms."""
_SAME_SIDE: Final = 0.5
"""Cosine: a touch comes from outside, so a surface it lies on faces the way it came from."""
_APART: Final = 5.0 * DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternative:
    """Another pose that fits the touches.

    Attributes:
        T_base_part: (4, 4).
        axis_in_part: (3,) it is turned about, against the pose found.
        angle: rad, by how much.
        rms: m, what it leaves.
    """

    T_base_part: Array
    axis_in_part: Array
    angle: float
    rms: float

    def __str__(self) -> str:
        """One sentence for a report."""
        x, y, z = self.axis_in_part
        return (
            f"The part turned by {self.angle / DEG:.1f} deg about ({x:+.2f}, {y:+.2f}, {z:+.2f}) "
            f"leaves {self.rms / MM:.3f} mm rms: the touches do not separate the two."
        )


def symmetric_alternatives(
    touches: ProbingSet,
    in_base: Array,
    T_base_part: Array,
    *,
    sigma: float,
    believed: BoolArray | None = None,
) -> tuple[Alternative, ...]:
    """Returns other poses the touches fit as well, each once; empty where none was found.

    From quarter and half turns about the part's own axes, the main directions of the touched
    normals and the axes of cylinders. Give ``touches`` all surfaces of the part, also those that
    were not touched: a block is the same turned by half a turn only if its back exists.

    Args:
        touches: On surfaces, as fitted.
        in_base: (n, 3) m, where the tip was.
        T_base_part: (4, 4), the fit.
        sigma: m, noise of one touch along its normal.
        believed: (n,) True where a touch was fitted; all if not given.

    Fails when: the symmetry is another one, of 60 deg for a hexagon say. Planes have no edges here:
    three touched faces of a block look alike whatever its sides; a mesh knows how long they are.
    """
    T, parts = T_base_part, list_distances(touches, np.asarray(in_base))
    distance, normal, _ = linearise_distances(parts, T)
    used = np.ones(len(touches), dtype=bool) if believed is None else believed
    limit = LEFT * max(sigma, float(np.sqrt(np.mean(distance[used] ** 2))))
    out: list[Alternative] = []
    pivot = _middle(parts, T)
    for axis in _axes(parts, normal @ T[:3, :3]):
        for angle in TURNS:
            turn = matrix_from_rotation_vector(axis * angle)
            start = T @ pose(turn, pivot - turn @ pivot)
            option = _settle(parts, start, normal, used, limit)
            known = [T, *(alternative.T_base_part for alternative in out)]
            if option is None or min(_between(option[0], k) for k in known) <= _APART:
                continue
            vector = rotation_vector_from_matrix(T[:3, :3].T @ option[0][:3, :3])
            size = float(np.linalg.norm(vector))
            axis_in_part = frozen(vector / size, (3,), "axis_in_part")
            out.append(
                Alternative(
                    T_base_part=option[0], axis_in_part=axis_in_part, angle=size, rms=option[1]
                )
            )
    return tuple(out)


def _settle(
    touches: SurfaceDistances, start: Array, normal: Array, used: BoolArray, limit: float
) -> tuple[Array, float] | None:
    """Returns the pose near a start if it fits, with every touch still coming from outside."""
    try:
        T, here = start, touches
        for again in (False, True):
            chosen = _facing(here, T, normal)
            if chosen is None:
                return None
            if again and (chosen == here.touched).all():
                break
            here = replace(here, touched=chosen)
            T = solve_frame(here, T, used.astype(float))
    except (ObservabilityError, ConvergenceError):
        return None
    distance, new_normal, _ = linearise_distances(here, T)
    rms = float(np.sqrt(np.mean(distance[used] ** 2)))
    outside = (new_normal * normal).sum(axis=1)[used] > _SAME_SIDE
    return (T, rms) if rms <= limit and outside.all() else None


def _facing(touches: SurfaceDistances, T: Array, normal: Array) -> IntArray | None:
    """Returns each touch's nearest surface of those that face the way it came from."""
    in_part = apply(inverse(T), touches.centre)
    cost = np.full((len(touches.surfaces), len(in_part)), np.inf)
    for index, surface in enumerate(touches.surfaces):
        distance, direction = surface.nearest(in_part)
        facing = ((direction @ T[:3, :3].T) * normal).sum(axis=1) > _SAME_SIDE
        # A mesh is one surface: it is used as it is and checked when the fit has converged.
        facing |= isinstance(surface, TriangleMesh)
        cost[index] = np.where(facing, np.abs(distance - touches.radius), np.inf)
    if np.isinf(cost.min(axis=0)).any():
        return None
    return np.asarray(np.argmin(cost, axis=0), dtype=np.int64)


def _axes(touches: SurfaceDistances, normal_in_part: Array) -> list[Array]:
    candidates = [
        *np.eye(3),
        *np.linalg.eigh(normal_in_part.T @ normal_in_part)[1].T,
        *(s.axis for s in touches.surfaces if isinstance(s, Cylinder)),
    ]
    axes: list[Array] = []
    for axis in candidates:
        if all(abs(float(axis @ other)) < np.cos(_APART) for other in axes):
            axes.append(axis)
    return axes


def _middle(touches: SurfaceDistances, T: Array) -> Array:
    for surface in touches.surfaces:
        if isinstance(surface, TriangleMesh):
            return surface.centre
    return np.asarray(apply(inverse(T), touches.centre).mean(axis=0))


def _between(a: Array, b: Array) -> float:
    return float(np.linalg.norm(rotation_vector_from_matrix(a[:3, :3].T @ b[:3, :3])))
