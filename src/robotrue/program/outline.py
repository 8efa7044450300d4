"""The outer boundary of a drawing of straight segments: the visible edges of a shadow.

The segments are cut at all their crossings, and the drawing is walked once around from its lowest
left point, taking at every crossing the rightmost way. Points nearer to each other than a tenth of
a micrometre are one point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ConvergenceError

SNAP: Final = 1e-7
"""m."""
_BLOCK: Final = 1 << 20
"""Pairs looked at together."""
_ROWS: Final = 500
"""Points looked at together."""


def outer_boundaries(segments: Array) -> list[Array]:
    """Returns one closed polygon (k, 2) m, counter-clockwise, for each separate piece of a drawing.

    Pieces inside another one are left out, as are holes: only what lies outermost remains. The
    first point is not repeated at the end.

    Args:
        segments: (n, 2, 2) m, ends of the segments, in any order and sense.

    Raises:
        ConvergenceError: The walk does not close; the drawing is not made of closed loops.
    """
    nodes, edges = _planar(segments)
    found = [_walk_around(nodes, edges[piece]) for piece in _pieces(len(nodes), edges)]
    loops = [loop for loop in found if len(loop) > 2]
    loops.sort(key=lambda loop: -abs(area(loop)))
    kept: list[Array] = []
    for loop in loops:
        if not any(inside(each, loop[:1])[0] for each in kept):
            kept.append(loop)
    return kept


def area(polygon: Array) -> float:
    """Returns the area in m^2 of a polygon (k, 2) m; positive counter-clockwise."""
    x, y = polygon[:, 0], polygon[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def inside(polygon: Array, points: Array) -> BoolArray:
    """Returns which points (n, 2) m lie in a polygon (k, 2) m, by crossings of a ray along x."""
    out = np.zeros(len(points), dtype=np.bool_)
    start, end = polygon, np.roll(polygon, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    order = np.argsort(points[:, 1], kind="stable")
    for rows in np.array_split(order, max(len(order) // _ROWS, 1)):  # of about the same height
        x, y = points[rows, 0, None], points[rows, 1, None]
        if not len(rows):
            continue
        here = (low <= y[-1]) & (high >= y[0])
        a, b = start[here], end[here]
        spans = (a[:, 1] > y) != (b[:, 1] > y)
        rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
        at = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
        out[rows] = (spans & (x < at)).sum(axis=1) % 2 == 1
    return out


def distance(polygon: Array, points: Array, *, within: float = np.inf) -> Array:
    """Returns the distance (n,) m of points (n, 2) m to the line of a polygon (k, 2) m.

    Args:
        polygon: (k, 2) m.
        points: (n, 2) m.
        within: m; of points farther away only that they are: infinity.
    """
    out = np.full(len(points), np.inf)
    end = np.roll(polygon, -1, axis=0)
    low, high = np.minimum(polygon, end) - within, np.maximum(polygon, end) + within
    order = np.argsort(points[:, 1], kind="stable")
    for rows in np.array_split(order, max(len(order) // _ROWS, 1)):  # of about the same height
        if not len(rows):
            continue
        part = points[rows]
        here = (low[:, 1] <= part[-1, 1]) & (high[:, 1] >= part[0, 1])
        if not here.any():
            continue
        start, along = polygon[here], end[here] - polygon[here]
        square = np.maximum((along**2).sum(axis=1), SNAP**2)
        x, y = part[:, 0, None] - start[:, 0], part[:, 1, None] - start[:, 1]
        share = np.clip((x * along[:, 0] + y * along[:, 1]) / square, 0.0, 1.0)
        x -= share * along[:, 0]
        y -= share * along[:, 1]
        out[rows] = np.sqrt((x * x + y * y).min(axis=1))
    return np.where(out <= within, out, np.inf)


def _planar(segments: Array) -> tuple[Array, IntArray]:
    """Nodes (m, 2) and edges (e, 2) of the drawing, cut where segments cross or touch."""
    first, second, share = _crossings(segments)
    owner = np.concatenate([np.arange(len(segments))] * 2 + [first, second])
    where = np.concatenate([np.zeros(len(segments)), np.ones(len(segments)), share[0], share[1]])
    order = np.lexsort((where, owner))
    owner, where = owner[order], where[order]
    start, along = segments[owner, 0], segments[owner, 1] - segments[owner, 0]
    snapped = np.rint((start + where[:, None] * along) / SNAP)
    nodes, index = np.unique(snapped, axis=0, return_inverse=True)
    index = index.ravel()
    same = owner[1:] == owner[:-1]
    edges = np.stack([index[:-1], index[1:]], axis=1)[same]
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1), axis=0)
    return nodes * SNAP, edges


def _crossings(segments: Array) -> tuple[IntArray, IntArray, Array]:
    """Pairs of segments that cross or touch, and where on each: shares (2, p) of 0..1.

    Parallel segments that overlap touch at the ends of either.
    """
    low, high = segments.min(axis=1) - SNAP, segments.max(axis=1) + SNAP
    order = np.argsort(low[:, 0], kind="stable")
    last = np.searchsorted(low[order, 0], high[order, 0], side="right")
    count = last - np.arange(len(order)) - 1
    found: list[tuple[IntArray, IntArray, Array]] = []
    begin = 0
    while begin < len(order):
        total = np.cumsum(count[begin:])
        stop = begin + max(int(np.searchsorted(total, _BLOCK)), 1)
        rows = np.arange(begin, stop)
        a = np.repeat(rows, count[rows])
        offset = np.arange(len(a)) - np.repeat(np.cumsum(count[rows]) - count[rows], count[rows])
        i, j = order[a], order[a + 1 + offset]
        meet = (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
        found.append(_meet(segments, i[meet], j[meet]))
        begin = stop
    return _join(found)


def _meet(segments: Array, i: IntArray, j: IntArray) -> tuple[IntArray, IntArray, Array]:
    """Proper crossings of pairs, and ends of one that lie on the other."""
    a, u = segments[i, 0], segments[i, 1] - segments[i, 0]
    b, v = segments[j, 0], segments[j, 1] - segments[j, 0]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    size = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    skew = np.abs(cross) > 1e-12 * size
    safe = np.where(skew, cross, 1.0)
    apart = b - a
    s = (apart[:, 0] * v[:, 1] - apart[:, 1] * v[:, 0]) / safe
    t = (apart[:, 0] * u[:, 1] - apart[:, 1] * u[:, 0]) / safe
    proper = skew & (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    pairs = [(i[proper], j[proper], np.stack([s[proper], t[proper]]))]
    for one, other in ((i, j), (j, i)):
        base, along = segments[other, 0], segments[other, 1] - segments[other, 0]
        square = np.maximum((along**2).sum(axis=1), SNAP**2)
        for end in (0, 1):
            point = segments[one, end]
            share = ((point - base) * along).sum(axis=1) / square
            foot = base + np.clip(share, 0.0, 1.0)[:, None] * along
            on = (np.linalg.norm(point - foot, axis=1) < SNAP) & (share > 0.0) & (share < 1.0)
            ends = np.full(int(on.sum()), float(end))
            pairs.append((one[on], other[on], np.stack([ends, share[on]])))
    return _join(pairs)


def _join(parts: Sequence[tuple[IntArray, IntArray, Array]]) -> tuple[IntArray, IntArray, Array]:
    i, j, share = zip(*parts, strict=True)
    return np.concatenate(i), np.concatenate(j), np.concatenate(share, axis=1)


def _pieces(count: int, edges: IntArray) -> list[BoolArray]:
    """Edges of each connected piece of the drawing."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    label = connected_components(graph, directed=False)[1][edges[:, 0]]
    return [np.asarray(label == each) for each in np.unique(label)]


def _walk_around(nodes: Array, edges: IntArray) -> Array:
    """The outer loop of one connected piece, counter-clockwise."""
    both = np.concatenate([edges, edges[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    tail, head = both[order, 0], both[order, 1]
    apart = nodes[head] - nodes[tail]
    bearing = np.arctan2(apart[:, 1], apart[:, 0])
    begin = np.searchsorted(tail, np.arange(len(nodes) + 1))
    used = np.unique(edges)
    start = int(used[np.lexsort((nodes[used, 0], nodes[used, 1]))[0]])  # lowest, then leftmost
    at, back, loop = start, np.pi, [start]
    first = -1
    for _ in range(2 * len(edges) + 1):
        ways = slice(int(begin[at]), int(begin[at + 1]))
        turn = np.mod(bearing[ways] - back, 2.0 * np.pi)
        turn = np.where(turn < 1e-12, 2.0 * np.pi, turn)  # straight back only from a dead end
        chosen = ways.start + int(np.argmin(turn))
        if at == start and chosen == first:
            return nodes[loop[:-1]]
        first = chosen if first < 0 else first
        at, back = int(head[chosen]), float(bearing[chosen]) + np.pi
        loop.append(at)
    raise ConvergenceError(
        f"the outline of a drawing of {len(edges)} edges does not close.",
        hint="check the mesh: it must be closed.",
    )
