"""Feature frame: three touched points K, L, M at a right angle, K at the corner.

The named baseline of shop practice and of Feng, Liang, Xi 2018 (J. Xiamen Univ. Nat. Sci. 57(5),
eq. 9-12): K is taken as exact, L only gives a direction, M only a plane. A point fit of the same
three points uses all of them and is about a third better.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.cell.registration.fit import Registration, point_residuals
from robotrue.cell.registration.points import check_pattern, check_points
from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, UM
from robotrue.errors import ImplausibleDataError

RIGHT_ANGLE: Final = 0.5 * DEG
"""The corner may be off 90 deg by this much before it is called another pattern."""
_STEP: Final = 1.0 * UM


def feature_frame(points: Array) -> Array:
    """Returns the pose (4, 4) of the feature: origin K, x to L, z normal to the triangle.

    n = (L-K)/|L-K|, a = (L-K)x(M-K)/|.|, o = a x n (right-handed; eq. 11 prints n x a, which has
    determinant -1), R = [n o a] (feature in base; eq. 12 prints its transpose).

    Args:
        points: (3, 3) m, K, L, M.

    Raises:
        ObservabilityError: The points coincide or lie on one line.
    """
    check_pattern(np.asarray(points, dtype=np.float64), ("K", "L", "M"))
    k, l, m = points  # noqa: E741
    n = (l - k) / np.linalg.norm(l - k)
    a = np.cross(l - k, m - k)
    a = a / np.linalg.norm(a)
    return pose(np.stack([n, np.cross(a, n), a], axis=1), k)


def fit_feature_frame(
    in_part: Array,
    in_base: Array,
    *,
    sigma: float,
    names: tuple[str, ...] = ("K", "L", "M"),
    right_angle: float = RIGHT_ANGLE,
) -> Registration:
    """Returns the frame that puts the part's feature frame on the touched one.

    Args:
        in_part: (3, 3) m, K (the corner), L, M in part.
        in_base: (3, 3) m, the same, touched, in base.
        sigma: m per axis of a touch; three points leave nothing to estimate it from that this
            construction would use.
        names: Of K, L, M.
        right_angle: rad, how far the nominal corner may be off a right angle.

    Raises:
        ShapeError: Not three points.
        ObservabilityError: Coincident or collinear points.
        ImplausibleDataError: No right angle at the first point; swapped names usually.
    """
    part, base, labels = check_points(in_part, in_base, names)
    check_corner(part, labels, tolerance=right_angle)
    # A touched corner may be off by more than a drawn one: the robot's own error.
    check_corner(base, labels, tolerance=4.0 * right_angle, where="base")
    T_part_feature = feature_frame(part)
    T_base_part = feature_frame(base) @ inverse(T_part_feature)
    gain = _gain(base, T_part_feature, T_base_part)
    return Registration(
        method="feature-frame",
        T_base_part=T_base_part,
        covariance=sigma**2 * gain @ gain.T,
        names=labels,
        residuals=point_residuals(T_base_part, part, base),
        sigma=sigma,
        sigma_source="stated",
        degrees_of_freedom=3,
    )


def _gain(base: Array, T_part_feature: Array, T_base_part: Array) -> Array:
    """Returns (6, 9): step of the frame per error of K, L, M, by central differences."""
    out = np.empty((6, 9))
    for i in range(9):
        shift = np.zeros(9)
        shift[i] = _STEP
        ends = [
            feature_frame(base + s * shift.reshape(3, 3)) @ inverse(T_part_feature)
            for s in (1.0, -1.0)
        ]
        turn = ends[0][:3, :3] @ ends[1][:3, :3].T
        out[:3, i] = ends[0][:3, 3] - ends[1][:3, 3]
        out[3:, i] = rotation_vector_from_matrix(turn)
    return out / (2.0 * _STEP)


def check_corner(
    points: Array,
    names: tuple[str, ...],
    *,
    tolerance: float = RIGHT_ANGLE,
    where: str = "part",
) -> None:
    """Passes if three points (3, 3) m have a right angle at the first.

    Args:
        points: K, L, M.
        names: Of them.
        tolerance: rad.
        where: Frame, for the message.

    Raises:
        ObservabilityError: The points coincide or lie on one line.
        ImplausibleDataError: No right angle there; says where it is.
    """
    check_pattern(points, names)
    sides = points - points[[1, 2, 0]]
    angles = []
    for i in range(3):
        u, v = -sides[i], sides[(i + 2) % 3]
        angles.append(float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v)))
    if abs(angles[0] - 0.5 * np.pi) <= tolerance:
        return
    best = int(np.argmin([abs(a - 0.5 * np.pi) for a in angles]))
    hint = f"the right angle is at {names[best]}" if best else "use a point fit"
    raise ImplausibleDataError(
        f"the corner {names[0]} measures {angles[0] / DEG:.3f} deg in {where}, expected 90 within "
        f"{tolerance / DEG:.2f} deg.",
        hint=f"{hint}; the corner comes first, then the points along x and y.",
    )
