"""3-2-1: three touches on the first face, two on the second, one on the third. Named baseline.

The part is laid on the plane through the first three, turned in it along the next two, and pushed
against the last. No touch is left to contradict: form error and noise go straight into the frame.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import Registration
from robotrue.cell.registration.touches import fit_all_touches
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import pose
from robotrue.core.surfaces import Plane
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet

_THINNEST: Final = 1e-3
"""Rad: three touches closer to one line, or two faces closer to parallel, fix nothing."""


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
