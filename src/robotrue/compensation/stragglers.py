"""Inversion of the few targets that the lanes leave over: nearly singular, or slow to arrive.

Newton with a Jacobian renewed wherever a step takes off less than nine tenths of the error, and
inverses by singular values.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.compensation.lanes import STRAGGLER, look
from robotrue.compensation.memory import Aim, Arm, Asked, Space
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray, IntArray

ITERATIONS: Final = 25
FLAT: Final = 1e-13
"""Singular value that is rounding alone."""


@np.errstate(over="ignore", invalid="ignore")  # steps out of all bounds are refused by size
def invert_stragglers(arm: Arm, aim: Aim, asked: Asked, rows: IntArray, space: Space) -> None:
    """Writes code, joints, command and errors of the stragglers among ``rows`` into ``asked``."""
    rows = rows[asked.code[rows] == STRAGGLER]
    if not len(rows):
        return
    joints = np.array(asked.nominal[rows])
    inverses = np.zeros((len(rows), 6, 6))
    size_before = np.full(len(rows), np.inf)
    asked.code[rows] = Status.UNCHANGED_NOT_CONVERGED
    open_ = np.arange(len(rows))
    for iteration in range(ITERATIONS):
        if not len(open_):
            return
        at = rows[open_]
        real, matrix = np.empty((len(at), 12)), np.empty((len(at), 6, 6))
        wrist = np.empty(len(at))
        look(arm, asked, at, joints[open_], space, real, matrix, wrist)
        error, turn = _deviation(real, asked.target[at])
        shift = np.linalg.norm(error[:, :3], axis=1)
        asked.after[at] = error[:, :3]
        size = shift + arm.length * turn
        going: BoolArray = np.ones(len(at), dtype=np.bool_)
        slow = np.flatnonzero((iteration == 0) | (size > 0.1 * size_before[open_]))
        inverse, least, norm = _inverse(matrix[slow])
        inverses[open_[slow]] = inverse
        flat = slow[least < FLAT]
        asked.code[at[flat]] = Status.UNCHANGED_SINGULAR
        going[flat] = False
        if iteration == 0:
            asked.before[at] = error[:, :3]
            asked.singular[at] = np.where(least < FLAT, 0.0, 1.0 / norm)
            near = np.asarray(going & (asked.singular[at] < aim.min_singular_value))
            asked.code[at[near]] = Status.UNCHANGED_SINGULAR
            stretched = np.asarray(going & (wrist < aim.min_wrist_sine))
            asked.code[at[stretched]] = Status.UNCHANGED_WRIST_SINGULAR
            going &= ~(near | stretched)
        done = np.asarray(going & (shift < aim.tolerance) & (turn < aim.turn_tolerance))
        asked.code[at[done]] = Status.COMPENSATED
        going &= ~done & (size < 1e3)
        size_before[open_] = size
        open_, error = open_[going], error[going]
        error[:, :3] /= arm.length
        joints[open_] -= (inverses[open_] @ error[:, :, None])[:, :, 0]


def _inverse(matrix: Array) -> tuple[Array, Array, Array]:
    """Returns inverses (k, 6, 6), least singular values and Frobenius norms of the inverses."""
    finite = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    sane = np.where(finite[:, None, None], matrix, 0.0)
    left, values, right = np.linalg.svd(sane)
    bounded = np.maximum(values, 1e-300)
    inverse = np.swapaxes(right, 1, 2) @ (np.swapaxes(left, 1, 2) / bounded[:, :, None])
    norm = np.linalg.norm(1.0 / np.maximum(values, 1e-150), axis=1)
    return inverse, values[:, -1], norm


def _deviation(poses: Array, targets: Array) -> tuple[Array, Array]:
    """Returns pose minus target (k, 6) in m and the sine of the rotation vector, and the turn.

    Beyond a quarter turn the vector is stretched to the angle, so that steps stay long enough.
    """
    a, b = poses[:, :9].reshape(-1, 3, 3), targets[:, :9].reshape(-1, 3, 3)
    twist = 0.5 * np.cross(b, a, axis=1).sum(axis=2)
    turn = np.linalg.norm(twist, axis=1)
    trace = np.sum(a * b, axis=(1, 2))
    angle = np.arctan2(turn, 0.5 * (trace - 1.0))
    factor = np.where(trace < 1.0, angle / np.maximum(turn, 1e-6), 1.0)
    error = np.concatenate([poses[:, 9:] - targets[:, 9:], twist * factor[:, None]], axis=1)
    return error, turn * factor
