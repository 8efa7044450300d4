"""A tool path with points between far ones: what the controller drives through on the way.

Moves are straight; a point is added every 20 mm and every 5 deg of tool axis. Frames are carried
along the path without turning about the axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.carried import carried_frames
from robotrue.program.toolpath import Toolpath

MOST_STATIONS: Final = 2000
_TURN_LENGTH: Final = 0.2
"""m of path that a radian of tool axis counts as."""
_TILT: Final = 5.0 * DEG
_APART: Final = 20.0 * MM


@dataclass(frozen=True, slots=True, kw_only=True)
class DensePath:
    """A path with points between far ones.

    Attributes:
        position: (d, 3) m in part.
        frame: (d, 3, 3) carried frame, z against the tool axis.
        along: (d,) m of path so far; a turn of the tool axis counts as well.
        target: (d,) the target at the end of the move each belongs to.
        at: (n,) where the targets are.
    """

    position: Array
    frame: Array
    along: Array
    target: IntArray
    at: IntArray


def as_driven(dense: DensePath, T_part_target: Array) -> Array:
    """Returns poses (d, 4, 4) on the way as a controller interpolates: straight, one rotation."""
    last = dense.target
    first = np.maximum(last - 1, 0)
    begin, end = dense.at[first], dense.at[last]
    span = dense.along[end] - dense.along[begin]
    share = np.where(span > 0.0, dense.along - dense.along[begin], 1.0) / np.where(
        span > 0.0, span, 1.0
    )
    share = np.where(np.arange(len(last)) == end, 1.0, share)
    R0, R1 = T_part_target[first, :3, :3], T_part_target[last, :3, :3]
    turn = rotation_vector_from_matrix(np.swapaxes(R0, 1, 2) @ R1)
    rotation = R0 @ matrix_from_rotation_vector(share[:, None] * turn)
    return pose(rotation, dense.position)


def dense_path(path: Toolpath) -> DensePath:
    """Returns the path with points between far ones."""
    steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    cosine = np.clip((path.axis[1:] * path.axis[:-1]).sum(axis=1), -1.0, 1.0)
    tilt = np.arccos(cosine)
    parts = np.maximum(np.ceil(np.maximum(steps / _APART, tilt / _TILT)), 1.0).astype(int)
    target = np.concatenate([[0], np.repeat(np.arange(1, len(path)), parts)])
    at = np.concatenate([[0], np.cumsum(parts)])
    share = np.concatenate([[1.0], _shares(parts)])
    first = np.maximum(target - 1, 0)
    blend = share[:, None]
    position = (1.0 - blend) * path.position[first] + blend * path.position[target]
    axis = _between(path.axis[first], path.axis[target], share)
    move = np.concatenate([[0.0], (steps + _TURN_LENGTH * tilt) / parts])
    along = np.cumsum(np.where(np.arange(len(target)) == 0, 0.0, move[target]))
    frame = carried_frames(axis, _perpendicular(axis[0]))
    return DensePath(position=position, frame=frame, along=along, target=target, at=at)


def _shares(parts: IntArray) -> Array:
    """1/p .. p/p for every move."""
    ends = np.cumsum(parts)
    count = np.arange(1, int(ends[-1]) + 1) if len(parts) else np.arange(0)
    return np.asarray((count - np.repeat(ends - parts, parts)) / np.repeat(parts, parts))


def _between(first: Array, last: Array, share: Array) -> Array:
    """Unit vectors on the great circle between two, (d, 3)."""
    cosine = np.clip((first * last).sum(axis=1), -1.0, 1.0)
    angle = np.arccos(cosine)
    aside = last - cosine[:, None] * first
    length = np.linalg.norm(aside, axis=1)
    opposite = (length < 1e-12) & (cosine < 0.0)
    if opposite.any():
        aside[opposite] = [_perpendicular(axis) for axis in first[opposite]]
    aside /= np.where(length < 1e-12, 1.0, length)[:, None]
    turned = share * angle
    return np.asarray(np.cos(turned)[:, None] * first + np.sin(turned)[:, None] * aside)


def _perpendicular(axis: Array) -> Array:
    """The unit vector across an axis nearest to the coordinate axis most across it."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    aside = aside - (aside @ axis) * axis
    return np.asarray(aside / np.linalg.norm(aside))


def stations_of(dense: DensePath, spacing: float) -> IntArray:
    """Returns dense points (m,) about every ``spacing`` m, first and last among them."""
    step = max(spacing, float(dense.along[-1]) / MOST_STATIONS)
    cell = np.floor(dense.along / step)
    chosen = np.concatenate([[True], cell[1:] > cell[:-1]])
    chosen[-1] = True
    return np.flatnonzero(chosen)
