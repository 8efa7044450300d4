"""Other poses of a part that its surface touches cannot tell from the one found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.cell.registration.surface_distances import (
    SurfaceDistances,
    linearise_distances,
    list_distances,
    solve_frame,
)
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.surfaces import Cylinder, TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConvergenceError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet

TURNS: Final = (90.0 * DEG, 180.0 * DEG, 270.0 * DEG)
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
            f"leaves {self.rms / MM:.3f} mm rms: the touches cannot tell."
        )


def symmetric_alternatives(
    touches: ProbingSet,
    in_base: Array,
    T_base_part: Array,
    *,
    sigma: float,
    believed: BoolArray | None = None,
    factor: float = 1.5,
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
        factor: An alternative may leave this many times the larger of sigma and the fit's own
            rms.

    Fails when: the symmetry is another one, of 60 deg for a hexagon say. Planes have no edges here:
    three touched faces of a block look alike whatever its sides; a mesh knows how long they are.
    """
    T, parts = T_base_part, list_distances(touches, np.asarray(in_base))
    distance, normal, _ = linearise_distances(parts, T)
    used = np.ones(len(touches), dtype=bool) if believed is None else believed
    limit = factor * max(sigma, float(np.sqrt(np.mean(distance[used] ** 2))))
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
        # A mesh is one surface: it is taken as it is and judged when the fit has settled.
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
