"""Distances of straight segments to one another and to boxes, balls and half-spaces. Vectorised.

A tube (capsule) is a segment with a radius; two tubes touch where their segments are nearer than
the sum of the radii. Segments are arrays (..., 2, 3) m: start and end.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.cell.obstacles import Box, HalfSpace, Obstacle
from robotrue.core.arrays import Array

_SHORT: Final = 1e-12
"""m^2; a segment with a smaller squared length is a point."""
_HALVINGS: Final = 60
"""Steps of the search along a segment; each takes a third off."""


def between_segments(a: Array, b: Array) -> Array:
    """Returns the distance (...) m of segments a and b, both (..., 2, 3) m.

    Source: Ericson 2005, "Real-Time Collision Detection", section 5.1.9 (closest points of two
    segments).
    """
    along_a, along_b = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :]
    apart = a[..., 0, :] - b[..., 0, :]
    aa, bb = (along_a**2).sum(axis=-1), (along_b**2).sum(axis=-1)
    ab = (along_a * along_b).sum(axis=-1)
    ar, br = (along_a * apart).sum(axis=-1), (along_b * apart).sum(axis=-1)
    square = aa * bb - ab * ab
    skewed = square > 1e-12 * aa * bb
    s = np.where(skewed, (ab * br - ar * bb) / np.where(skewed, square, 1.0), 0.0)
    s = np.clip(s, 0.0, 1.0)
    t = _share(ab * s + br, bb)
    s = np.where(
        aa > _SHORT, np.clip((ab * t - ar) / np.where(aa > _SHORT, aa, 1.0), 0.0, 1.0), 0.0
    )
    gap = apart + s[..., None] * along_a - t[..., None] * along_b
    return np.asarray(np.linalg.norm(gap, axis=-1))


def to_point(segment: Array, point: Array) -> Array:
    """Returns the distance (...) m of segments (..., 2, 3) to points (..., 3), m."""
    along = segment[..., 1, :] - segment[..., 0, :]
    apart = point - segment[..., 0, :]
    t = _share((along * apart).sum(axis=-1), (along**2).sum(axis=-1))
    return np.asarray(np.linalg.norm(apart - t[..., None] * along, axis=-1))


def to_obstacle(segment: Array, obstacle: Obstacle) -> Array:
    """Returns the distance (...) m of segments (..., 2, 3) m to a body; zero or less is inside."""
    if isinstance(obstacle, Box):
        return _to_box(segment, obstacle)
    if isinstance(obstacle, HalfSpace):
        return np.asarray(((segment - obstacle.point) @ obstacle.normal).min(axis=-1))
    return to_point(segment, obstacle.centre) - obstacle.radius


def _to_box(segment: Array, box: Box) -> Array:
    """The distance to a convex body is convex along a segment: thirds find its minimum."""

    def distance(t: Array) -> Array:
        point = segment[..., 0, :] + t[..., None] * (segment[..., 1, :] - segment[..., 0, :])
        outside = np.maximum(np.maximum(box.low - point, point - box.high), 0.0)
        return np.asarray(np.linalg.norm(outside, axis=-1))

    low, high = np.zeros(segment.shape[:-2]), np.ones(segment.shape[:-2])
    for _ in range(_HALVINGS):
        third = (high - low) / 3.0
        nearer = distance(low + third) <= distance(high - third)
        low, high = np.where(nearer, low, low + third), np.where(nearer, high - third, high)
    return distance(0.5 * (low + high))


def _share(numerator: Array, square: Array) -> Array:
    long = square > _SHORT
    return np.where(long, np.clip(numerator / np.where(long, square, 1.0), 0.0, 1.0), 0.0)
