"""Arcs of a plane with a centre or a radius, as three points and back.

A corrected arc is the circle of the plane through its corrected start, middle and end. What the
correction takes out of the plane at the middle is not followed; the ends are met, so that the arc
becomes a helix if need be. The centre moves by what the circle's does, so that an arc whose points
stay keeps its words.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.number_table import Numbers

ACROSS: Final = np.array([[0, 1, 2], [2, 0, 1], [1, 2, 0]])
"""For G17, G18, G19 the axes of the plane, right-handed about the third."""
_SAME_SIDE: Final = 1e-3
"""Printed units that the middle of about half a circle may be off on either side of its chord."""
_SMALL_CHORD: Final = 0.01
"""Chord over radius below which the middle of the arc determines its centre."""


class Centre(IntEnum):
    """Forms of an arc's centre."""

    FROM_START = 0
    ABSOLUTE = 1
    RADIUS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneArcs:
    """k arcs.

    Attributes:
        start: (k,) row of the point before.
        via: (k,) row of the middle.
        end: (k,) row of the end.
        kind: (k,) :class:`Centre`.
        plane: (k,) 0 XY, 1 ZX, 2 YZ.
        left: (k,) counter-clockwise about the third axis.
        numbers: (k, 3) I, J, K, or the radius in the first column.
        value: (k, 3) as printed; what is left out is 0.
    """

    start: IntArray
    via: IntArray
    end: IntArray
    kind: IntArray
    plane: IntArray
    left: BoolArray
    numbers: Numbers
    value: Array

    def __len__(self) -> int:
        return len(self.end)


def no_arcs() -> PlaneArcs:
    """Returns none."""
    none, empty = np.empty(0, np.int64), np.empty((0, 3))
    return PlaneArcs(
        start=none, via=none, end=none, kind=none, plane=none, left=np.empty(0, np.bool_),
        numbers=Numbers(
            start=np.empty((0, 3), np.int64), length=np.empty((0, 3), np.int64), value=empty
        ),
        value=empty,
    )  # fmt: skip


def middles(arcs: PlaneArcs, value: Array) -> tuple[Array, Array]:
    """Returns the middle (k, 3) of arcs and their miss (k,), in printed units.

    The miss is the difference of the distances of start and end from the centre, infinite where
    there is no circle.

    Args:
        arcs: The arcs.
        value: (n, 3) points in printed units.
    """
    start, end = value[arcs.start], value[arcs.end]
    centre = _centres(arcs, start, end)
    u, v, w = in_plane(arcs.plane, start), in_plane(arcs.plane, end), in_plane(arcs.plane, centre)
    a, b = u - w, v - w
    with np.errstate(invalid="ignore"):
        r, s = np.hypot(*a.T), np.hypot(*b.T)
        turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
        turn = np.where(arcs.left, turn, -turn)
        same = np.hypot(*(v - u).T) <= 1e-9 * np.maximum(r, 1.0)
        turn = np.where(same, 2.0 * np.pi, np.mod(turn, 2.0 * np.pi))
        half = np.where(arcs.left, 0.5, -0.5) * turn
        mean = 0.5 * (r + s)
        c, d = np.cos(half), np.sin(half)
        across = np.stack([c * a[:, 0] - d * a[:, 1], d * a[:, 0] + c * a[:, 1]], axis=1)
        across *= (mean / np.where(r > 0.0, r, np.nan))[:, None]
        miss = np.where(np.isfinite(across).all(axis=1), np.abs(r - s), np.inf)
    rows, axes = np.arange(len(arcs))[:, None], ACROSS[arcs.plane]
    out = 0.5 * (start + end)
    out[rows, axes[:, :2]] = w + across
    return out, miss


def moved_words(arcs: PlaneArcs, old: Array, new: Array) -> Array:
    """Returns the new I, J, K or radius (k, 3) when points (n, 3) change.

    Args:
        arcs: The arcs.
        old: (n, 3) points in printed units.
        new: (n, 3) likewise.
    """
    out = np.array(arcs.value)
    before = _fit_centres(arcs, old)
    after = _fit_centres(arcs, new)
    rows, axes = np.arange(len(arcs)), ACROSS[arcs.plane]
    by_centre = arcs.kind != Centre.RADIUS
    shift = after - before
    shift -= np.where((arcs.kind == Centre.FROM_START)[:, None], _step(arcs, old, new), 0.0)
    for k in (0, 1):
        column = axes[:, k]
        out[rows[by_centre], column[by_centre]] += shift[by_centre, k]
    radius = np.hypot(*(in_plane(arcs.plane, new[arcs.start]) - after).T)
    radius -= np.hypot(*(in_plane(arcs.plane, old[arcs.start]) - before).T)
    by_radius = ~by_centre
    sign = np.where(arcs.value[:, 0] < 0.0, -1.0, 1.0)
    out[by_radius, 0] += (sign * radius)[by_radius]
    return _choose_sides(replace(arcs, value=out), new).value


def _choose_sides(arcs: PlaneArcs, points: Array) -> PlaneArcs:
    """Changes the sign of radii where a correction has brought the centre across the chord."""
    radius = (arcs.kind == Centre.RADIUS)[:, None] & np.array([True, False, False])
    other = replace(arcs, value=np.where(radius, -arcs.value, arcs.value))
    wanted = in_plane(arcs.plane, points[arcs.via])
    here, across = (
        np.hypot(*(in_plane(arcs.plane, middles(each, points)[0]) - wanted).T)
        for each in (arcs, other)
    )
    better = (here > _SAME_SIDE) & (across < here)
    return replace(arcs, value=np.where(better[:, None], other.value, arcs.value))


def _step(arcs: PlaneArcs, old: Array, new: Array) -> Array:
    return in_plane(arcs.plane, new[arcs.start]) - in_plane(arcs.plane, old[arcs.start])


def _fit_centres(arcs: PlaneArcs, points: Array) -> Array:
    """Centre (k, 2) of the circle in the plane through start, middle and end."""
    s, m, e = (in_plane(arcs.plane, points[row]) for row in (arcs.start, arcs.via, arcs.end))
    chord, half = e - s, 0.5 * (s + e)
    rise = m - half
    across = np.stack([-chord[:, 1], chord[:, 0]], axis=1)
    size = np.hypot(*chord.T)
    small = size < _SMALL_CHORD * np.hypot(*rise.T)
    across = np.where(small[:, None], rise, across)
    length = np.hypot(*across.T)
    across = across / np.where(length > 0.0, length, 1.0)[:, None]
    along = (rise * across).sum(axis=1)
    # |c - s| = |c - m| with c = half + t across.
    gap = (s - half) ** 2
    t = ((rise**2).sum(axis=1) - gap.sum(axis=1)) / np.where(along != 0.0, 2.0 * along, np.nan)
    if small.any():
        t = np.where(small, _on_ray(s - half, rise, across), t)
    out: Array = half + np.nan_to_num(t)[:, None] * across
    return out


def _on_ray(s: Array, m: Array, across: Array) -> Array:
    """Distance of the point of a ray that is as far from ``s`` as from ``m``."""
    apart = ((m - s) * across).sum(axis=1)
    square = (m**2).sum(axis=1) - (s**2).sum(axis=1)
    return np.asarray(0.5 * square / np.where(apart != 0.0, apart, np.nan))


def in_plane(plane: IntArray, points: Array) -> Array:
    """Returns the two coordinates (k, 2) in its plane of each of points (k, 3)."""
    out: Array = np.take_along_axis(points, ACROSS[plane][:, :2], axis=1)
    return out


def _centres(arcs: PlaneArcs, start: Array, end: Array) -> Array:
    """Centre (k, 3), printed units; of a radius the one on the side of its sign."""
    centre = arcs.value + np.where((arcs.kind == Centre.FROM_START)[:, None], start, 0.0)
    by_radius = np.flatnonzero(arcs.kind == Centre.RADIUS)
    if not len(by_radius):
        return centre
    axes = ACROSS[arcs.plane[by_radius]][:, :2]
    s = np.take_along_axis(start[by_radius], axes, axis=1)
    e = np.take_along_axis(end[by_radius], axes, axis=1)
    radius = arcs.value[by_radius, 0]
    chord = e - s
    size = np.hypot(*chord.T)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = radius**2 - 0.25 * size**2
        # Half a circle whose printed radius is rounded down is half a circle.
        square = np.where(np.abs(square) < 2e-3 * np.abs(radius), np.maximum(square, 0.0), square)
        away = np.sqrt(square) * np.sign(radius) * np.where(arcs.left[by_radius], 1.0, -1.0)
        normal = np.stack([-chord[:, 1], chord[:, 0]], axis=1) / size[:, None]
        flat = 0.5 * (s + e) + away[:, None] * normal
    np.put_along_axis(centre_rows := centre[by_radius], axes, flat, axis=1)
    centre[by_radius] = centre_rows
    return centre
