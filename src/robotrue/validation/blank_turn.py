"""The small turn of a part in its blank that leaves most, where shifting alone leaves too little.

The part may turn about an axis that keeps what was not touched where it is: the side it lies on
stays parallel to itself, and no face turns that nothing is known opposite of. With turn w and shift
s, small, a vertex v of the part stays inside a face (normal n, offset d) by

    d - n.v - n.s - w.(v x n) >= t,

a linear program in s, w and the least allowance t, solved again about the turned part.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import linprog

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG

LARGEST: Final = 5.0 * DEG
"""rad; a blank that lies farther off is to be set up again."""
STEPS: Final = 3
ALIKE: Final = 0.35
"""Sine below which a normal counts as along an axis."""
NEAREST: Final = 64
"""Vertices of the part kept for each face: those nearest to it."""


def turning_axes(paired: Array, alone: Array) -> Array:
    """Returns the axes (r, 3) a part may turn about, in the part.

    Args:
        paired: (p, 3) one normal of each pair of opposite touched faces.
        alone: (q, 3) normals of touched faces with nothing touched opposite.
    """
    if not len(paired):
        return np.empty((0, 3))
    _, size, rows = np.linalg.svd(paired)
    rank = int(np.count_nonzero(size > ALIKE * size[0]))
    if rank < 2:
        return np.empty((0, 3))
    axes = np.eye(3) if rank == 3 else rows[2:]
    for normal in alone:  # only the turn about its own normal leaves such a face alike
        axes = axes[np.linalg.norm(np.cross(axes, normal), axis=1) < ALIKE]
    return np.asarray(axes)


def best_turn(vertices: Array, normals: Array, offsets: Array, axes: Array, shifts: Array) -> Array:
    """Returns the rotation vector (3,) rad of the part in itself that leaves most.

    Args:
        vertices: (v, 3) m of the part.
        normals: (f, 3) of the blank's faces, outward, in the part.
        offsets: (f,) m, points p of a face have ``normal @ p = offset``.
        axes: (r, 3) it may turn about.
        shifts: (k, 3) directions it may move along.
    """
    turn = np.zeros(3)
    for _ in range(STEPS):
        turned = vertices @ matrix_from_rotation_vector(turn).T
        rows, room = [], []
        for normal, offset in zip(normals, offsets, strict=True):
            depth = turned @ normal
            near = turned[np.argsort(-depth)[:NEAREST]]
            moment = np.cross(near, normal)
            one = np.ones((len(near), 1))
            rows.append(np.hstack([one * (shifts @ normal), moment @ axes.T, one]))
            room.append(offset - near @ normal)
        count = len(shifts) + len(axes)
        limit = [(None, None)] * len(shifts) + [(-LARGEST, LARGEST)] * len(axes) + [(None, None)]
        found = linprog(
            np.append(np.zeros(count), -1.0),
            A_ub=np.vstack(rows),
            b_ub=np.concatenate(room),
            bounds=limit,
        )
        if found.status != 0 or found.x is None:
            return np.zeros(3)
        turn = turn + found.x[len(shifts) : count] @ axes
    return np.asarray(np.zeros(3) if np.linalg.norm(turn) > LARGEST else turn)


def turned_allowances(
    vertices: Array, normals: Sequence[Array], offsets: Array, turn: Array
) -> Array:
    """Returns the allowance (f,) m of every face over the part turned in itself."""
    turned = vertices @ matrix_from_rotation_vector(turn).T
    return np.asarray(offsets - (turned @ np.asarray(normals).T).max(axis=0))
