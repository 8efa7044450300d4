"""Homogeneous poses ``T_a_b`` (b in a): (..., 4, 4) arrays, metres."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.rotations import matrix_from_abc, skew
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError


def pose(rotation: Array, translation: Array) -> Array:
    """Returns T from R (..., 3, 3) and p (..., 3) in m; shape (..., 4, 4)."""
    rotation = np.asarray(rotation, dtype=np.float64)
    translation = np.asarray(translation, dtype=np.float64)
    lead = np.broadcast_shapes(rotation.shape[:-2], translation.shape[:-1])
    out = np.zeros((*lead, 4, 4))
    out[..., :3, :3] = rotation
    out[..., :3, 3] = translation
    out[..., 3, 3] = 1.0
    return out


def pose_from_xyz_abc(xyz: Array, abc: Array) -> Array:
    """Returns T from xyz (..., 3) m and KUKA A, B, C (..., 3) rad; shape (..., 4, 4)."""
    return pose(matrix_from_abc(abc), xyz)


def inverse(transform: Array) -> Array:
    """Returns the inverse pose, ``T_b_a`` from ``T_a_b``; shape (..., 4, 4)."""
    rotation_t = np.swapaxes(transform[..., :3, :3], -1, -2)
    return pose(rotation_t, -(rotation_t @ transform[..., :3, 3:])[..., 0])


def apply(transform: Array, points: Array) -> Array:
    """Returns ``p_a = T_a_b p_b`` for points (..., 3) in m."""
    return (transform[..., :3, :3] @ points[..., None])[..., 0] + transform[..., :3, 3]


def displacement_columns(lever: Array) -> Array:
    """Returns how a frame's displacement moves its points: (..., 3, 6) = [I, -[lever]x].

    The displacement is that of the origin (m), then the left rotation vector (rad), in the axes of
    the levers (..., 3) m from the origin to the points.
    """
    shift = np.broadcast_to(np.eye(3), (*lever.shape, 3))
    return np.concatenate([shift, -skew(lever)], axis=-1)


def propagate_covariance(covariance: Array, lever: Array) -> Array:
    """Returns the covariance (n, 3, 3) m^2 of points at levers (n, 3) m from a frame's origin.

    Args:
        covariance: (6, 6) of the frame's displacement: origin (m) and left rotation vector (rad).
        lever: Point minus origin, in the same axes.
    """
    columns = displacement_columns(lever)
    return np.asarray(columns @ covariance @ np.swapaxes(columns, -1, -2))


def check_mirror(points_part: Array, points_base: Array, weights: Array | None = None) -> None:
    """Rejects a part that is mirrored: a pattern with depth fits its mirror image far better.

    Args:
        points_part: (n, 3) m, nominal.
        points_base: (n, 3) m, touched.
        weights: (n,) non-negative; equal if not given.

    Raises:
        ImplausibleDataError: The touched points are the mirror image of the part.
    """
    w = np.ones(len(points_part)) if weights is None else weights
    images = points_part, points_part * np.array([1.0, 1.0, -1.0])
    misfits = [points_base - apply(fit_rigid(image, points_base, w), image) for image in images]
    here, there = (float(np.sqrt(w @ (misfit**2).sum(axis=1))) for misfit in misfits)
    spread = points_part - points_part.mean(axis=0)
    size = float(np.sqrt(w @ (spread**2).sum(axis=1)))
    if here > 1e-2 * size and there < 0.1 * here:
        rms = float(np.sqrt((misfits[0] ** 2).sum(axis=1).mean()))
        raise ImplausibleDataError(
            f"the touched points are the mirror image of the part: {rms / MM:.3g} mm rms "
            f"residual, {rms * there / here / MM:.3g} mm with one axis of the part reversed.",
            hint="check the sign of one coordinate, or the order of the names.",
        )


def fit_rigid(points_b: Array, points_a: Array, weights: Array | BoolArray | None = None) -> Array:
    """Returns the ``T_a_b`` (..., 4, 4) that best takes points in b to points in a.

    Weighted least squares over proper rotations (Kabsch 1976; Umeyama 1991, eq. 40-43, no scale).

    Args:
        points_b: (..., n, 3) m.
        points_a: (..., n, 3) m.
        weights: (..., n) non-negative, or the points that count; equal if not given.

    Fails when: the points lie on one line; the rotation about it is then arbitrary.
    """
    w = np.ones(points_b.shape[:-1]) if weights is None else np.asarray(weights, dtype=np.float64)
    w = (w / w.sum(axis=-1, keepdims=True))[..., None]
    mean_b, mean_a = (np.swapaxes(w, -1, -2) @ points for points in (points_b, points_a))
    u, _, vt = np.linalg.svd(np.swapaxes((points_a - mean_a) * w, -1, -2) @ (points_b - mean_b))
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    rotation = u @ vt
    return pose(rotation, (mean_a - mean_b @ np.swapaxes(rotation, -1, -2))[..., 0, :])
