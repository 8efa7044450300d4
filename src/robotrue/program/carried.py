"""Frames carried along a tool axis: the sixth degree of freedom where a file prints only five.

A carried frame follows the tool axis by the smallest rotations and never turns about it. Its z is
the way from the spindle to the tip; the spin of a tool is counted from its x, right-handed about z.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector


def carried_frames(axis: Array, side: Array) -> Array:
    """Returns frames (n, 3, 3) with z against the tool axis, carried along the path.

    Args:
        axis: (n, 3) unit vectors from the tip to the spindle, n > 0.
        side: (3,) unit vector across the first of them: x of the first frame.
    """
    sides = np.empty_like(axis)
    moved = np.flatnonzero(np.any(axis[1:] != axis[:-1], axis=1)) + 1
    ends = np.append(moved, len(axis))
    sides[: ends[0]] = side
    carried = tuple(side.tolist())
    for k, end in pairwise(ends.tolist()):
        carried = carry(carried, axis[k - 1].tolist(), axis[k].tolist())
        sides[k:end] = carried
    z = -axis
    return np.stack([sides, np.cross(z, sides), z], axis=-1)


def carry(
    side: tuple[float, ...], before: list[float], after: list[float]
) -> tuple[float, float, float]:
    """Returns the side vector after the smallest rotation from one tool axis to the next."""
    # Plain floats: of a hundred thousand points each needs the one before.
    (x, y, z), (a, b, c), (u, v, w) = side, before, after
    cosine = a * u + b * v + c * w
    if cosine > -1.0 + 1e-9:  # else any half turn will do, and the side stays
        p, q, r = b * w - c * v, c * u - a * w, a * v - b * u
        i, j, k = q * z - r * y, r * x - p * z, p * y - q * x
        scale = 1.0 / (1.0 + cosine)
        x += i + scale * (q * k - r * j)
        y += j + scale * (r * i - p * k)
        z += k + scale * (p * j - q * i)
    off = x * u + y * v + z * w  # rounding
    x, y, z = x - off * u, y - off * v, z - off * w
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def about_z(angle: Array) -> Array:
    """Returns rotations (..., 3, 3) about z by angles (...) rad."""
    out = np.zeros((*np.shape(angle), 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = np.cos(angle)
    out[..., 1, 0] = np.sin(angle)
    out[..., 0, 1] = -out[..., 1, 0]
    out[..., 2, 2] = 1.0
    return out


def to_z(cutter: Array) -> Array:
    """Returns the smallest rotation (3, 3) that takes the cutter axis (3,) to z."""
    across, cosine = np.cross(cutter, [0.0, 0.0, 1.0]), float(cutter[2])
    sine = float(np.linalg.norm(across))
    if sine < 1e-12:
        return np.eye(3) if cosine > 0.0 else np.diag([1.0, -1.0, -1.0])
    return matrix_from_rotation_vector(across / sine * np.arctan2(sine, cosine))
