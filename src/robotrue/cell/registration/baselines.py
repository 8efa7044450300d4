"""Frames built through as few touches as there are unknowns: the named baselines.

Feature frame: three touched points K, L, M at a right angle, K at the corner; shop practice and
Feng, Liang, Xi 2018 (J. Xiamen Univ. Nat. Sci. 57(5), eq. 9-12): K is taken as exact, L only gives
a direction, M only a plane. A point fit of the same three points uses all of them and is about a
third better.

3-2-1: three touches on the first face, two on the second, one on the third. The part is laid on the
plane through the first three, turned in it along the next two, and pushed against the last. No
touch is left to contradict: form error and noise go straight into the frame.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import (
    Registration,
    check_pattern,
    check_points,
    point_residuals,
)
from robotrue.cell.registration.touches import fit_all_touches
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import Plane
from robotrue.core.units import DEG, UM
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet

RIGHT_ANGLE: Final = 0.5 * DEG
"""The corner may be off 90 deg by this much before it is called another pattern."""
_STEP: Final = 1.0 * UM
_THINNEST: Final = 1e-3
"""Rad: three touches closer to one line, or two faces closer to parallel, fix nothing."""


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
    """Returns the frame that maps the part's feature frame to the touched one.

    Args:
        in_part: (3, 3) m, K (the corner), L, M in part.
        in_base: (3, 3) m, the same, touched, in base.
        sigma: m per axis of a touch; this construction cannot estimate it from three points.
        names: Of K, L, M.
        right_angle: rad, largest deviation of the nominal corner from a right angle.

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
    gain = feature_frame_gain(base, T_part_feature)
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


def feature_frame_gain(base: Array, T_part_feature: Array) -> Array:
    """Returns (6, 9): step of the frame (origin, left rotation vector) per error of K, L, M.

    By central differences.

    Args:
        base: (3, 3) m, K, L, M as touched.
        T_part_feature: (4, 4) of the nominal ones, :func:`feature_frame`.
    """
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
        ImplausibleDataError: No right angle there; states where it is.
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


def fit_three_two_one(
    faces: tuple[Plane, Plane, Plane],
    centre: Array,
    *,
    sigma: float,
    radius: float = 0.0,
    names: tuple[str, ...] = ("A1", "A2", "A3", "B1", "B2", "C1"),
) -> Registration:
    """Returns the frame in which all six touches lie exactly on their faces.

    Needs no start: each face must lie where the touches of the other two are behind it, as on
    any convex corner.

    Args:
        faces: First, second and third face of the part, normals out of the material.
        centre: (6, 3) m in base, probe centres: three on the first face, two, one.
        sigma: m along the normal.
        radius: m, of the probe.
        names: Of the touches.

    Raises:
        ObservabilityError: The first three on one line, the two at one place, or faces that do
            not meet in a corner.
        ImplausibleDataError: Touches that form the mirror image of the corner: faces swapped.
    """
    touched: Array = frozen(centre, (6, 3), "centre")
    touches = ProbingSet(
        names=names,
        point=np.zeros((6, 3)),
        position=touched,
        surfaces=faces,
        touched=np.array([0, 0, 0, 1, 1, 2]),
        radius=radius,
    )
    start = _lay_on_faces(faces, touched, radius, names)
    return replace(fit_all_touches(touches, touched, sigma=sigma, start=start), method="3-2-1")


def _lay_on_faces(
    faces: tuple[Plane, Plane, Plane], q: Array, radius: float, names: tuple[str, ...]
) -> Array:
    """Returns the frame of three faces at right angles laid on the touches."""
    across = np.cross(q[1] - q[0], q[2] - q[0])
    longest = max(float(np.linalg.norm(q[i] - q[j])) for i, j in ((0, 1), (1, 2), (2, 0)))
    if np.linalg.norm(across) <= _THINNEST * longest**2:
        raise ObservabilityError(
            f"{names[0]}, {names[1]}, {names[2]} lie on one line and give no plane.",
            hint="spread the three touches of the first face.",
        )
    first = _outward(across, q[:3].mean(axis=0), q[3:])
    along = q[4] - q[3]
    along = along - (along @ first) * first
    if np.linalg.norm(along) <= _THINNEST * float(np.linalg.norm(q[4] - q[3])) or not along.any():
        raise ObservabilityError(
            f"{names[3]} and {names[4]} give no direction along the first face.",
            hint="touch the second face at two places side by side.",
        )
    second = _outward(np.cross(along, first), q[3:5].mean(axis=0), np.vstack([q[:3], q[5:]]))
    n1, n2, n3 = (face.normal for face in faces)
    corner = np.stack([n1, n2, n3])
    if abs(np.linalg.det(corner)) <= 0.1:
        raise ObservabilityError(
            "the three faces do not meet in a corner: "
            f"their normals span a volume of {abs(np.linalg.det(corner)):.3f}, allowed 0.1 to 1."
        )
    in_part = _orthonormal(n1, n2)
    in_base = _orthonormal(first, second)
    R = in_base @ in_part.T
    third = R @ n3
    if third @ (q[5] - q[:5].mean(axis=0)) < 0.0:
        raise ImplausibleDataError(
            f"{names[5]} lies on the far side of the part: the touches are the mirror image of "
            "the corner.",
            hint="the first and second face are probably swapped, or one coordinate's sign.",
        )
    normals = np.stack([first, second, third])
    offsets = np.array(
        [
            normal @ point - radius - face.normal @ face.point
            for normal, point, face in zip(
                normals, (q[0], q[3:5].mean(axis=0), q[5]), faces, strict=True
            )
        ]
    )
    return pose(R, np.linalg.solve(normals, offsets))


def _outward(direction: Array, on_face: Array, behind: Array) -> Array:
    normal = direction / np.linalg.norm(direction)
    side = float(np.mean((behind - on_face) @ normal))
    return np.asarray(-normal if side > 0.0 else normal)


def _orthonormal(first: Array, second: Array) -> Array:
    y = second - (second @ first) * first
    y = y / np.linalg.norm(y)
    return np.stack([first, y, np.cross(first, y)], axis=1)
