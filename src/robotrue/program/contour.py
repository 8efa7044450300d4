"""The largest contour of a part seen from one side, and the tool path that stays inside it.

A part cut from several sides falls free of its blank when each side is cut only inside the part's
largest contour as that side sees it: points outside are dropped and the lifts mended (Feng, Liang,
Xi 2018, section 2, "largest contour method"; the paper gives the rule in words only). Read here as:

* The contour is the outer boundary of the part's shadow along the tool axis of the side. Holes
  through the part lie inside the contour and are cut. Of several bodies each has its own.
* A point that cuts is kept when its tip lies in the contour or on it, or outside by no more than a
  margin.
* Rapid points between two cuts that were neighbours before stay as the CAM system made them. Where
  points that cut were dropped, the rapid points there are dropped too: the tool is lifted along
  its axis from the last point kept to the height of the CAM system's highest rapid point, and a
  clearance above part and path at least, flies to above the next point kept and goes down with
  that point's feed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ShapeError
from robotrue.program.outline import SNAP, distance, inside, outer_boundaries
from robotrue.program.toolpath import Toolpath

TILT: Final = 30.0 * DEG
"""Largest angle between a tool axis and the mean of its side."""
CLEARANCE: Final = 10.0 * MM
"""Of lifts over part and path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contour:
    """The outer boundary of a part's shadow.

    Attributes:
        direction: (3,) unit vector in the part frame, from the part to the spindle.
        across: (2, 3) unit vectors of the plane of the shadow.
        outlines: Closed polygons (k, 2) m in that plane, one per separate body.
        top: m, height of the part along ``direction``.
    """

    direction: Array
    across: Array
    outlines: tuple[Array, ...]
    top: float

    def __post_init__(self) -> None:
        """Freezes the arrays."""
        object.__setattr__(self, "direction", frozen(self.direction, (3,), "direction"))
        object.__setattr__(self, "across", frozen(self.across, (2, 3), "across"))

    def outside_by(self, points: Array) -> Array:
        """Returns the distance of points (n, 3) m in part outside, (n,) m; negative inside."""
        flat = np.asarray(points) @ self.across.T
        out = np.full(len(flat), np.inf)
        for outline in self.outlines:
            gap = distance(outline, flat)
            out = np.minimum(out, np.where(inside(outline, flat), -gap, gap))
        return out

    def keeps(self, points: Array, *, margin: float = 0.0) -> BoolArray:
        """Returns which points (n, 3) m in part lie inside, or outside by at most ``margin`` m."""
        flat = np.asarray(points) @ self.across.T
        out = np.zeros(len(flat), dtype=np.bool_)
        for outline in self.outlines:
            out |= inside(outline, flat)
            rest = np.flatnonzero(~out)
            out[rest] = np.isfinite(distance(outline, flat[rest], within=margin + SNAP))
        return out


def contour_of(mesh: TriangleMesh, direction: Array) -> Contour:
    """Returns the largest contour of a part seen against ``direction`` (3,) in the part frame.

    Exact: the outer boundary of the projected triangles, from the edges between those that face
    the tool and those that do not.

    Raises:
        ImplausibleDataError: The mesh has holes; a shadow has then no edge.
        ShapeError: A direction of length zero.
    """
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        raise ShapeError(f"direction has length {length:g}, expected a direction.")
    if mesh.open_edges:
        raise ImplausibleDataError(
            f"{mesh.open_edges} edges of the mesh do not have exactly one triangle on either side: "
            "a mesh with holes has no contour.",
            hint="repair the mesh in CAD and export it again.",
        )
    toward = np.asarray(direction, dtype=np.float64) / length
    across = _across(toward)
    facing = mesh.faces[mesh.normals @ toward > 1e-9]
    start = facing[:, [0, 1, 2]].ravel()
    end = facing[:, [1, 2, 0]].ravel()
    size = len(mesh.vertices)
    rim = ~np.isin(start * size + end, end * size + start)
    flat = mesh.vertices @ across.T
    segments = np.stack([flat[start[rim]], flat[end[rim]]], axis=1)
    return Contour(
        direction=toward,
        across=across,
        outlines=tuple(outer_boundaries(segments)),
        top=float((mesh.vertices @ toward).max()),
    )


def side_direction(path: Toolpath) -> Array:
    """Returns the mean tool axis (3,) of the points of a side that cut.

    Raises:
        ImplausibleDataError: Nothing cuts, or an axis is more than 30 deg off the mean: the path
            is not of one side.
    """
    axes = path.axis[path.cutting]
    if not len(axes):
        raise ImplausibleDataError("no move of the tool path cuts.", source=path.source)
    mean = axes.mean(axis=0)
    mean = mean / max(float(np.linalg.norm(mean)), 1e-12)
    cosine = axes @ mean
    if cosine.min() < np.cos(TILT):
        worst = np.flatnonzero(path.cutting)[int(np.argmin(cosine))]
        raise ImplausibleDataError(
            f"the tool axis is {np.degrees(np.arccos(cosine.min())):.0f} deg off the mean of the "
            f"path, a contour is seen from one side (at most {TILT / DEG:.0f} deg).",
            source=path.source,
            line=int(path.line[worst]),
            hint="post one file per side, or leave the mesh out.",
        )
    return np.asarray(mean)


def keep_inside(
    path: Toolpath, contour: Contour, *, margin: float = 0.0, clearance: float = CLEARANCE
) -> Toolpath:
    """Returns the path with only the cutting points inside a contour, and its lifts mended.

    Args:
        path: One side; its tool axes within 30 deg of the contour's direction.
        contour: Of the part, seen from that side.
        margin: m a tip may lie outside.
        clearance: m over part and path that lifts reach at least.

    Raises:
        ImplausibleDataError: No point that cuts lies inside: another frame, or another unit.
    """
    cuts = np.flatnonzero(path.cutting)
    kept = np.zeros(len(path), dtype=np.bool_)
    kept[cuts] = contour.keeps(path.position[cuts], margin=margin)
    if not kept.any():
        apart = contour.outside_by(path.position[cuts])
        nearest = float(apart.min()) if len(cuts) else np.inf
        raise ImplausibleDataError(
            f"no point of the tool path lies inside the largest contour of the mesh; the nearest "
            f"is {nearest / MM:.3f} mm outside.",
            source=path.source,
            hint="check that mesh and tool path are in the same frame and unit.",
        )
    pick, over, lifts = _mend(path, kept)
    position = path.position[pick]
    position[over] += _lift(path, contour, pick[over], clearance)
    rapid = path.rapid[pick] | over
    dropped = len(cuts) - int(kept.sum())
    note = (
        f"{path.source}: {int(kept.sum())} of {len(cuts)} cutting points lie inside the largest "
        f"contour; {dropped} were dropped and {lifts} lifts made."
    )
    return path.with_points(pick, position=position, rapid=rapid, notes=(note,))


def _mend(path: Toolpath, kept: BoolArray) -> tuple[IntArray, BoolArray, int]:
    """Old index of each new point, which of them are lifted over it, and the number of lifts."""
    pick: list[int] = []
    over: list[bool] = []
    waiting: list[int] = []
    gap, lifts, last = False, 0, -1

    def emit(index: int, lifted: bool) -> None:
        pick.append(index)
        over.append(lifted)

    for k, (rapid, keep) in enumerate(zip(path.rapid.tolist(), kept.tolist(), strict=True)):
        if rapid:
            waiting.append(k)
        elif not keep:
            gap = True
        else:
            if not gap:
                for each in waiting:
                    emit(each, False)
            else:
                if last >= 0:
                    emit(last, True)
                    lifts += 1
                emit(k, True)
            emit(k, False)
            waiting, gap, last = [], False, k
    if gap:
        emit(last, True)
        lifts += 1
    else:
        for each in waiting:
            emit(each, False)
    return np.array(pick, dtype=np.int64), np.array(over, dtype=np.bool_), lifts


def _lift(path: Toolpath, contour: Contour, points: IntArray, clearance: float) -> Array:
    """Returns the way (m, 3) m along the tool axis from points to the height of flight."""
    height = path.position @ contour.direction
    level = max(contour.top, float(height[path.cutting].max())) + clearance
    level = max(level, float(height.max()))
    axis = path.axis[points]
    way = (level - height[points]) / np.maximum(axis @ contour.direction, np.cos(2.0 * TILT))
    return np.asarray(way[:, None] * axis)


def _across(direction: Array) -> Array:
    """Two unit vectors (2, 3) that make a right-handed frame with a direction."""
    aside = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = np.cross(aside, direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])
