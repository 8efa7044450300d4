"""Surface fit: the frame in which every touch lies on its surface, a probe radius away.

Gauss-Newton on point-to-surface distances. On a mesh it is point-to-plane ICP (Chen and Medioni
1992): the nearest facet is found anew in every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.cell.registration.fit import Registration, displace_frame, name_touches
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.observable import check_motions
from robotrue.core.poses import apply, inverse
from robotrue.core.surfaces import Surface
from robotrue.errors import ConvergenceError, ObservabilityError, ShapeError

STEPS: Final = 200
_STILL: Final = 1e-9
"""m at the size of the pattern: a smaller step is none."""
_GAIN: Final = 1e-9
"""A step that lowers the squared distances by less than this part of them is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceTouches(Columns):
    """Probe centres and the surfaces they touched.

    Attributes:
        surfaces: Of the part.
        touched: (n,) index of each touch's surface.
        centre: (n, 3) m in base, of the probe's ball (or the point itself with radius 0).
        radius: m, of the ball.
        names: One per touch; empty: "1" to "n".
    """

    surfaces: tuple[Surface, ...]
    touched: Annotated[IntArray, Column("n")]
    centre: Annotated[Array, Column("n 3", unit="m")]
    radius: float = 0.0
    names: tuple[str, ...] = ()

    def _check_rules(self) -> None:
        """Checks indices, radius and names.

        Raises:
            ShapeError: Wrong names or indices, or a negative radius.
        """
        touched = self.touched
        if len(touched) and not 0 <= touched.min() <= touched.max() < len(self.surfaces):
            raise ShapeError(
                f"touched names surfaces {touched.min()} to {touched.max()}, there are "
                f"{len(self.surfaces)}, counted from 0."
            )
        if not 0.0 <= self.radius < np.inf:
            raise ShapeError(f"probe radius is {self.radius:g} m, expected 0 or more.")
        names = name_touches(self.names or None, len(self.centre))
        object.__setattr__(self, "names", names)


def on_mesh(
    mesh: Surface, centre: Array, *, radius: float = 0.0, names: tuple[str, ...] = ()
) -> SurfaceTouches:
    """Returns touches (n, 3) m in base that all lie on one surface, such as a mesh."""
    return SurfaceTouches(
        surfaces=(mesh,),
        touched=np.zeros(len(centre), dtype=np.int64),
        centre=centre,
        radius=radius,
        names=names,
    )


def fit_surfaces(
    touches: SurfaceTouches,
    start: Array,
    *,
    sigma: float | None = None,
    weights: Array | None = None,
    method: str = "surfaces",
) -> Registration:
    """Returns the frame that best lays the touches on their surfaces.

    Args:
        touches: Six or more, on surfaces that together fix all six directions.
        start: (4, 4) roughly ``T_base_part``. Planes forgive tens of degrees; a mesh about 25 deg
            and 50 mm with 30 touches or more.
        sigma: m along the normal; not given: from the residuals (seven touches or more).
        weights: (n,) 0 to 1; touches of weight 0 are ignored.
        method: Name for the result.

    Raises:
        ObservabilityError: Touches that leave a motion free, or nearly so; says which.
        ConvergenceError: No rest after many steps.
        ShapeError: Neither a sigma nor residuals to tell it from.

    Fails when: the part looks the same from another side (see ``symmetric_alternatives``), or the
    start on a mesh is too far: the fit then rests in a wrong place, with a ``misfit`` far above 1.
    """
    n = len(touches.centre)
    w = np.ones(n) if weights is None else np.asarray(weights, dtype=np.float64)
    used = w > 0.0
    freedom = int(used.sum()) - 6
    if sigma is None and freedom < 1:
        raise ShapeError(
            f"{int(used.sum())} touches leave no residual to tell the noise from; sigma in m "
            "is needed, or 7 touches or more."
        )
    T_base_part = solve_surfaces(touches, start, w)
    distance, normal, rows = linearised(touches, T_base_part)
    scale = sigma if sigma is not None else float(np.sqrt((w * distance**2).sum() / freedom))
    covariance = scale**2 * np.linalg.inv((rows * w[:, None]).T @ rows)
    return Registration(
        method=method,
        T_base_part=T_base_part,
        covariance=0.5 * (covariance + covariance.T),
        names=touches.names,
        residuals=distance[:, None] * normal,
        outliers=tuple(name for name, keep in zip(touches.names, used, strict=True) if not keep),
        sigma=scale,
        sigma_source="stated" if sigma is not None else "residuals",
        degrees_of_freedom=freedom,
    )


def linearised(touches: SurfaceTouches, T_base_part: Array) -> tuple[Array, Array, Array]:
    """Returns distances (n,) m less the radius, normals (n, 3) in base, and rows (n, 6).

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


def solve_surfaces(touches: SurfaceTouches, start: Array, weights: Array) -> Array:
    """Returns the frame (4, 4) of least weighted squared distance, from a start.

    Raises:
        ObservabilityError: Too few touches, or a motion the surfaces leave free.
        ConvergenceError: No rest after many steps.
    """
    T: Array = np.array(start, dtype=np.float64)
    root = np.sqrt(weights)
    size = float(np.ptp(touches.centre, axis=0).max()) if len(weights) else 0.0
    scale = np.array([1.0, 1.0, 1.0, size, size, size])
    distance, normal, _ = linearised(touches, T)
    used = weights > 0.0
    _check_count(weights)
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
            found = linearised(touches, new)
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


def _check_count(weights: Array) -> None:
    """Passes with six or more touches that count.

    Raises:
        ObservabilityError: Fewer.
    """
    used = int((weights > 0.0).sum())
    if used < 6:
        raise ObservabilityError(
            f"{used} touches on surfaces, a frame needs 6 or more: each fixes one direction.",
            hint="3 on the largest face, 2 on the next, 1 on the third is the least.",
        )


def assigned(touches: SurfaceTouches, touched: Sequence[int]) -> SurfaceTouches:
    """Returns the same touches given to other surfaces."""
    return SurfaceTouches(
        surfaces=touches.surfaces,
        touched=np.asarray(touched, dtype=np.int64),
        centre=touches.centre,
        radius=touches.radius,
        names=touches.names,
    )
