"""A side of a part, the box around part and paths, and the way out of it.

A side's tool path is lifted before its first and after its last point along the tool axis until the
tip has left the box by the lift height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.cell.obstacles import Box
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.mesh import TriangleMesh
from robotrue.core.poses import apply
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.program.toolpath import Toolpath

MOVED: Final = 30.0 * MM
"""Frames of sides that put a corner of the part further apart are different clampings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Side(Columns):
    """One side of the part and where it stands.

    Attributes:
        path: The tool path, in the part frame.
        T_base_part: (4, 4).
    """

    path: Toolpath
    T_base_part: Annotated[Array, Column("4 4")]


def require_one_clamping(sides: Sequence[Side], box: Box) -> None:
    """Passes for part frames near enough to be readings of one clamping.

    Raises:
        ConfigurationError: They put a corner of the box more than 30 mm apart.
    """
    corners = _corners(box)
    first = apply(sides[0].T_base_part, corners)
    for side in sides[1:]:
        apart = np.linalg.norm(apply(side.T_base_part, corners) - first, axis=1).max()
        if apart > MOVED:
            raise ConfigurationError(
                f"the part frames of {sides[0].path.source} and {side.path.source} put a corner of "
                f"the part {apart / MM:.0f} mm apart (at most {MOVED / MM:.0f} mm): it is clamped "
                "anew between them.",
                hint="write one program per clamping.",
            )


def box_around(sides: Sequence[Side], mesh: TriangleMesh | None) -> Box:
    """Returns the box around the mesh and all points that cut, in the part frame.

    Raises:
        ConfigurationError: Nothing cuts.
    """
    points = [side.path.position[side.path.cutting] for side in sides]
    if mesh is not None:
        points.append(mesh.vertices)
    found = np.concatenate(points)
    if not len(found):
        raise ConfigurationError(
            "no move of any tool path cuts.", source=sides[0].path.source, hint="check RAPID."
        )
    low, high = found.min(axis=0), found.max(axis=0)
    flat = 0.5 * MM * (high - low < MM)  # a box must have a volume
    return Box(name="the part", low=low - flat, high=high + flat)


def with_lifts(path: Toolpath, box: Box, lift: float) -> Toolpath:
    """Returns the path with a rapid point before and after it, where it is not outside already."""
    ends = np.array([0, len(path) - 1])
    way = _way_out(path.position[ends], path.axis[ends], box, lift)
    count = len(path)
    before, after = bool(way[0] > 0.0), bool(way[1] > 0.0)
    if not (before or after):
        return path
    pick = np.concatenate([[0] * before, np.arange(count), [count - 1] * after]).astype(np.int64)
    position = path.position[pick]
    rapid = path.rapid[pick]
    if before:
        position[0] += way[0] * path.axis[0]
        rapid[0] = True
    if after:
        position[-1] += way[1] * path.axis[-1]
        rapid[-1] = True
    return path.with_points(pick, position=position, rapid=rapid)


def _corners(box: Box) -> Array:
    """The eight corners (8, 3) m."""
    low_high = np.stack([box.low, box.high])
    index = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return np.asarray(low_high[index, np.arange(3)])


def _way_out(points: Array, axes: Array, box: Box, lift: float) -> Array:
    """How far (k,) m points must go along their axes until the lift's distance from the box."""
    low, high = box.low - lift, box.high + lift
    with np.errstate(divide="ignore"):
        out = np.where(
            np.abs(axes) < 1e-9,
            np.inf,
            np.where(axes > 0.0, high - points, low - points) / np.where(axes == 0.0, 1.0, axes),
        )
    inside = ((points > low) & (points < high)).all(axis=1)
    return np.where(inside, out.min(axis=1), 0.0)
