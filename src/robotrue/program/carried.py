"""Frames carried along a tool axis: the sixth degree of freedom where a file prints only five.

A carried frame follows the tool axis by the smallest rotations and never turns about it. Its z is
the way from the spindle to the tip; the spin of a tool is counted from its x, right-handed about z.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector


def carried_frames(axis: Array, side: Array, *, before: Array | None = None) -> Array:
    """Returns frames (n, 3, 3) with z against the tool axis, carried along the path.

    Args:
        axis: (n, 3) unit vectors from the tip to the spindle, n > 0.
        side: (3,) unit vector across the first of them: x of the first frame.
        before: (3,) the axis that ``side`` is across instead, where the path comes from.
    """
    axis = np.ascontiguousarray(axis, dtype=np.float64)
    sides = carried_sides(axis, side, axis[0] if before is None else before)
    z = -axis
    return np.stack([sides, np.cross(z, sides), z], axis=-1)


def carried_sides(axis: Array, side: Array, before: Array) -> Array:
    """Returns x (n, 3) of frames carried along tool axes (n, 3), n > 0.

    Args:
        axis: (n, 3) unit vectors, contiguous.
        side: (3,) unit vector: x of the frame that comes in.
        before: (3,) the tool axis there.
    """
    from robotrue.program.carried_kernels import carry_sides  # most programs carry nothing

    sides = np.empty_like(axis)
    sides[0] = side
    carry_sides(axis, before, sides)
    return sides


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
