"""Touches as distances from surfaces, and the frame that makes them least.

Gauss-Newton on point-to-surface distances. On a mesh it is point-to-plane ICP (Chen and Medioni
1992): the nearest facet is found anew in every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import displace_frame
from robotrue.core.arrays import Array, IntArray
from robotrue.core.observable import check_motions
from robotrue.core.poses import apply, inverse
from robotrue.core.surfaces import Surface
from robotrue.errors import ConvergenceError, ObservabilityError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet

STEPS: Final = 200
_STILL: Final = 1e-9
"""m at the size of the pattern: a smaller step is none."""
_GAIN: Final = 1e-9
"""A step that lowers the squared distances by less than this part of them is none."""


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

    A row times a step of the frame (origin in m, left rotation vector) is by how much the
    distance falls: [normal, (q - origin) x normal].
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
        ConvergenceError: No rest after many steps.
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
        f"{np.sqrt(cost / weights.sum()) * 1e3:.3g} mm rms are left.",
        hint="start nearer to the part's pose, or touch more points.",
    )
