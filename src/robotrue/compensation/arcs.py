"""Lines and circles in space: their course, and the distance of points from them.

All arrays are rows of k moves or n points; nothing here knows a robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray

_FLAT: Final = 1e-9
"""Sine between the chords of three points below which no circle goes through them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Circles:
    """k circles through a first, a second and a third point, run through in this order.

    Attributes:
        centre: (k, 3) m; NaN where the points lie on a line.
        radius: (k,) m.
        outward: (k, 3) unit vector from the centre to the first point.
        ahead: (k, 3) unit vector of the motion there.
        second: (k,) rad turned at the second point.
        third: (k,) rad turned at the third, less than a full turn.
    """

    centre: Array
    radius: Array
    outward: Array
    ahead: Array
    second: Array
    third: Array


def circles(first: Array, second: Array, third: Array) -> Circles:
    """Returns the circles through points (k, 3) m.

    With chords a and b from the first point and n = a x b the centre lies at
    ``first + (|b|^2 n x a + |a|^2 b x n) / (2 |n|^2)``.

    Fails when: the three lie on a line or two coincide; everything is NaN there.
    """
    a, b = second - first, third - first
    normal = np.cross(a, b)
    aa, bb = (np.sum(each * each, axis=-1) for each in (a, b))
    nn = np.sum(normal * normal, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        good = nn > _FLAT**2 * aa * bb
        scale = np.where(good, 0.5 / np.where(good, nn, 1.0), np.nan)
        across = bb[..., None] * np.cross(normal, a) + aa[..., None] * np.cross(b, normal)
        centre = first + scale[..., None] * across
        outward = first - centre
        radius = np.linalg.norm(outward, axis=-1)
        outward = outward / radius[..., None]
        ahead = np.cross(normal / np.sqrt(nn)[..., None], outward)
    angle = [_turn_angles(each - centre, outward, ahead) for each in (second, third)]
    return Circles(
        centre=centre, radius=radius, outward=outward, ahead=ahead, second=angle[0], third=angle[1]
    )


def _turn_angles(from_centre: Array, outward: Array, ahead: Array) -> Array:
    x, y = (np.sum(from_centre * axis, axis=-1) for axis in (outward, ahead))
    return np.asarray(np.arctan2(y, x) % (2.0 * np.pi))


def on_circles(circle: Circles, rows: IntArray, angle: Array) -> Array:
    """Returns points (n, 3) m of circles ``rows`` (n,) at angles (n,) rad from the first point."""
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned = cosine * circle.outward[rows] + sine * circle.ahead[rows]
    return np.asarray(circle.centre[rows] + circle.radius[rows, None] * turned)


def from_circles(points: Array, circle: Circles, rows: IntArray) -> Array:
    """Returns the distances (n,) m of points (n, 3) from circles ``rows`` (n,).

    With r the distance from the axis of the circle and z the height over its plane,
    ``d = sqrt((r - radius)^2 + z^2)``.
    """
    d = points - circle.centre[rows]
    x = np.sum(d * circle.outward[rows], axis=-1)
    y = np.sum(d * circle.ahead[rows], axis=-1)
    z = np.linalg.norm(
        d - x[:, None] * circle.outward[rows] - y[:, None] * circle.ahead[rows], axis=-1
    )
    return np.asarray(np.hypot(np.hypot(x, y) - circle.radius[rows], z))


def from_helices(points: Array, begin: Array, middle: Array, end: Array, normal: Array) -> Array:
    """Returns the distances (n,) m of points (n, 3) from arcs that stay in a plane as they turn.

    Seen along the normal the arc is the circle through begin, middle and end; along the normal it
    climbs from begin to end in proportion to its angle, whatever the middle does: the arcs of G2
    and G3. All arguments are (n, 3).
    """
    height = [np.sum(each * normal, axis=1) for each in (points, begin, end)]
    flat = [
        each - np.sum(each * normal, axis=1)[:, None] * normal
        for each in (points, begin, middle, end)
    ]
    circle = circles(*flat[1:])
    rows = np.arange(len(points))
    turned = _turn_angles(flat[0] - circle.centre, circle.outward, circle.ahead)
    # Just before the begin is nearly a full turn.
    turned = np.where(turned > 0.5 * circle.third + np.pi, turned - 2.0 * np.pi, turned)
    climb = height[1] + turned / circle.third * (height[2] - height[1])
    return np.asarray(np.hypot(from_circles(flat[0], circle, rows), height[0] - climb))


def from_segments(points: Array, start: Array, end: Array) -> Array:
    """Returns the distances (n,) m of points (n, 3) from straight lines between points (n, 3)."""
    chord = end - start
    length = np.sum(chord * chord, axis=-1)
    along = np.sum((points - start) * chord, axis=-1) / np.where(length > 0.0, length, 1.0)
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * chord
    return np.asarray(np.linalg.norm(points - nearest, axis=-1))
