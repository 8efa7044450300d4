"""What a controller makes of a program: straight lines and arcs between its targets."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.errors import FormatError
from robotrue.program.program import Motion, Program


def target_poses(program: Program) -> Array:
    """Returns T_base_tool (n, 4, 4) of every target; NaN for axis targets."""
    out: Array = program.T_base_frame[program.frame] @ pose(program.rotation, program.position)
    return out


def commanded_path(program: Program, rows: BoolArray, step: float) -> Array:
    """Returns T_base_tool (m, 4, 4) along the moves that end at the chosen targets.

    Each move starts at the target before it in the file, chosen or not; its start is not part of
    the result, its end is. Orientation turns evenly from start to end, as controllers do on lines
    and, with the usual setting, on arcs.

    Args:
        program: As read from a file.
        rows: (n,) True for the targets whose moves are wanted, via points included.
        step: m, largest distance between two points.

    Raises:
        FormatError: A chosen move is neither a line nor a whole arc, or has no start.
    """
    poses = target_poses(program)
    pieces: list[Array] = []
    for k in np.flatnonzero(rows):
        motion = program.motion[k]
        start = k - 2 if motion == Motion.ARC_END else k - 1
        if motion == Motion.ARC_VIA:
            continue
        known = start >= 0 and bool(np.isfinite(poses[start]).all())
        if not known or motion not in (Motion.LIN, Motion.ARC_END):
            raise FormatError(
                f"the move to this target is {Motion(int(motion)).name}, or starts nowhere; only "
                "lines and arcs between Cartesian targets can be followed.",
                source=program.name,
                line=int(program.line[k]),
            )
        if motion == Motion.LIN:
            places = _line(poses[start, :3, 3], poses[k, :3, 3], step)
        else:
            places = _arc(poses[start, :3, 3], poses[k - 1, :3, 3], poses[k, :3, 3], step)
        pieces.append(pose(_turning(poses[start], poses[k], len(places)), places))
    return np.concatenate(pieces) if pieces else np.empty((0, 4, 4))


def feed_directions(path: Array) -> Array:
    """Returns unit vectors (m, 3) along a path (m, 4, 4) of at least two points.

    Fails when: two neighbours coincide; the direction there is NaN.
    """
    along = np.gradient(path[:, :3, 3], axis=0)
    out: Array = along / np.linalg.norm(along, axis=1)[:, None]
    return out


def _fractions(length: float, step: float) -> Array:
    count = max(int(np.ceil(length / step)), 1)
    return np.arange(1, count + 1) / count


def _line(start: Array, end: Array, step: float) -> Array:
    share = _fractions(float(np.linalg.norm(end - start)), step)
    out: Array = start + share[:, None] * (end - start)
    return out


def _arc(start: Array, via: Array, end: Array, step: float) -> Array:
    """Points of the circle through three points, from start over via to end."""
    u, v = via - start, end - start
    normal = np.cross(u, v)
    square = float(normal @ normal)
    if square < 1e-24:  # three points on a line
        return _line(start, end, step)
    to_centre = np.cross(normal, (v @ v) * u - (u @ u) * v)
    centre = start + to_centre / (2.0 * square)
    radius = float(np.linalg.norm(start - centre))
    x = (start - centre) / radius
    y = np.cross(normal / np.sqrt(square), x)
    angle = float(np.arctan2((end - centre) @ y, (end - centre) @ x) % (2.0 * np.pi))
    turn = angle * _fractions(radius * angle, step)
    out: Array = centre + radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    return out


def _turning(start: Array, end: Array, count: int) -> Array:
    between = rotation_vector_from_matrix(start[:3, :3].T @ end[:3, :3])
    share = np.arange(1, count + 1) / count
    out: Array = start[:3, :3] @ matrix_from_rotation_vector(share[:, None] * between)
    return out
