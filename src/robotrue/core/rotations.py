"""Rotation matrices from and to what controllers and trackers print. All vectorised.

Every function takes and returns arrays with any leading shape. Angles in rad. The tables of users
of each convention are in CONVENTIONS.md.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array


def _elementary(angle: Array) -> tuple[Array, Array]:
    return np.cos(angle), np.sin(angle)


def matrix_from_abc(abc: Array) -> Array:
    """Returns R = Rz(A) Ry(B) Rx(C), shape (..., 3, 3).

    KUKA A, B, C. Fanuc W, P, R and Yaskawa Rx, Ry, Rz are the same matrix with A = R = Rz,
    B = P = Ry, C = W = Rx.

    Args:
        abc: (..., 3) rad, in the order A, B, C.
    """
    abc = np.asarray(abc, dtype=np.float64)
    (ca, sa), (cb, sb), (cc, sc) = (_elementary(abc[..., i]) for i in range(3))
    out = np.empty((*abc.shape[:-1], 3, 3))
    out[..., 0, 0] = ca * cb
    out[..., 0, 1] = ca * sb * sc - sa * cc
    out[..., 0, 2] = ca * sb * cc + sa * sc
    out[..., 1, 0] = sa * cb
    out[..., 1, 1] = sa * sb * sc + ca * cc
    out[..., 1, 2] = sa * sb * cc - ca * sc
    out[..., 2, 0] = -sb
    out[..., 2, 1] = cb * sc
    out[..., 2, 2] = cb * cc
    return out


def abc_from_matrix(rotation: Array, *, near: Array | None = None) -> Array:
    """Returns A, B, C in rad, shape (..., 3), with R = Rz(A) Ry(B) Rx(C).

    Args:
        rotation: (..., 3, 3).
        near: (..., 3) rad. Of the two Euler triples and their full turns the one nearest to this
            is returned; without it B lies in [-90, 90] deg and A, C in (-180, 180] deg.

    Fails when: B is +-90 deg exactly; then only A - C (or A + C) exists and ``near``, or C = 0
    without it, chooses the split.
    """
    r = np.asarray(rotation, dtype=np.float64)
    cos_b = np.hypot(r[..., 0, 0], r[..., 1, 0])
    b = np.arctan2(-r[..., 2, 0], cos_b)
    locked = cos_b < 1e-12
    a = np.where(locked, 0.0, np.arctan2(r[..., 1, 0], r[..., 0, 0]))
    c = np.where(locked, 0.0, np.arctan2(r[..., 2, 1], r[..., 2, 2]))
    sign = np.where(b > 0, 1.0, -1.0)
    # At the lock R depends on A - sign * C alone, and near it A and C are known to rounding over
    # cos B each, their difference to rounding; what is amiss is split evenly.
    difference = np.arctan2(sign * r[..., 1, 2] - r[..., 0, 1], r[..., 1, 1] + sign * r[..., 0, 2])
    if near is None:
        split = np.where(cos_b < 1e-3, wrap(difference - (a - sign * c)), 0.0)
        share = np.where(locked, 1.0, 0.5)
        a, c = a + share * split, c - sign * (1.0 - share) * split
        return np.stack([a, b, c], axis=-1)
    near = np.broadcast_to(np.asarray(near, dtype=np.float64), (*r.shape[:-2], 3))
    a, c = np.where(locked, near[..., 0], a), np.where(locked, near[..., 2], c)
    split = np.where(cos_b < 1e-3, wrap(difference - (a - sign * c)) / 2.0, 0.0)
    a, c = a + split, c - sign * split
    first = np.stack([a, b, c], axis=-1)
    second = np.stack([a + np.pi, np.pi - b, c + np.pi], axis=-1)
    first = near + wrap(first - near)
    second = near + wrap(second - near)
    distance = [np.sum((option - near) ** 2, axis=-1) for option in (first, second)]
    choose = (distance[1] < distance[0])[..., None]
    return np.where(choose, second, first)


def wrap(angle: Array) -> Array:
    """Returns the angle in [-pi, pi), rad."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def matrix_from_quat_wxyz(quat_wxyz: Array) -> Array:
    """Returns the rotation matrix of a quaternion [w, x, y, z], shape (..., 3, 3).

    The quaternion is normalised first (controllers print 6 to 8 decimals).
    """
    q = np.asarray(quat_wxyz, dtype=np.float64)
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    out = np.empty((*q.shape[:-1], 3, 3))
    out[..., 0, 0] = 1 - 2 * (y * y + z * z)
    out[..., 0, 1] = 2 * (x * y - z * w)
    out[..., 0, 2] = 2 * (x * z + y * w)
    out[..., 1, 0] = 2 * (x * y + z * w)
    out[..., 1, 1] = 1 - 2 * (x * x + z * z)
    out[..., 1, 2] = 2 * (y * z - x * w)
    out[..., 2, 0] = 2 * (x * z - y * w)
    out[..., 2, 1] = 2 * (y * z + x * w)
    out[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def quat_wxyz_from_matrix(rotation: Array) -> Array:
    """Returns the unit quaternion [w, x, y, z] with w >= 0 of a rotation, shape (..., 4)."""
    half = 0.5 * rotation_vector_from_matrix(rotation)
    # sinc of numpy is sin(pi x) / (pi x): no division by a vanishing angle.
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    # At half a turn the angle may be above pi / 2 by its rounding, and the cosine below zero.
    w = np.maximum(np.cos(angle), 0.0)
    return np.concatenate([w, half * np.sinc(angle / np.pi)], axis=-1)


def skew(vector: Array) -> Array:
    """Returns [v]x with [v]x u = v x u, shape (..., 3, 3)."""
    v = np.asarray(vector, dtype=np.float64)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def matrix_from_rotation_vector(vector: Array) -> Array:
    """Returns exp([v]x), shape (..., 3, 3); v (..., 3) rad (UR prints poses this way)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    k = skew(v)
    first = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    second = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    out: Array = np.eye(3) + first * k + second * (k @ k)
    return out


def rotation_vector_from_matrix(rotation: Array) -> Array:
    """Returns log(R) as a rotation vector in rad, shape (..., 3), length in [0, pi]."""
    r = np.asarray(rotation, dtype=np.float64)
    axis = 0.5 * np.stack(
        [
            r[..., 2, 1] - r[..., 1, 2],
            r[..., 0, 2] - r[..., 2, 0],
            r[..., 1, 0] - r[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(axis, axis=-1)
    cosine = 0.5 * (np.trace(r, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    out = axis * scale[..., None]
    # Near half a turn the skew part vanishes; the axis is then read from the symmetric part.
    half = (cosine < 0.0) & (sine < 1e-6)
    if np.any(half):
        symmetric = 0.5 * (r + np.swapaxes(r, -1, -2))[half]
        column = np.argmax(np.diagonal(symmetric, axis1=-2, axis2=-1), axis=-1)
        chosen = np.take_along_axis(symmetric, column[:, None, None], axis=-1)[..., 0]
        chosen = chosen + np.eye(3)[column]
        chosen /= np.linalg.norm(chosen, axis=-1, keepdims=True)
        sign = np.where(np.sum(chosen * axis[half], axis=-1) < 0, -1.0, 1.0)
        out[half] = chosen * (sign * angle[half])[:, None]
    return out
