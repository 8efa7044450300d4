"""Kernels that find the nominal joints of a target by Newton, for arms without a closed form."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robotrue.compensation.compiled import EXACT, compiled
from robotrue.compensation.status import Route
from robotrue.core.arrays import Array, IntArray

SKIP, GIVEN = int(Route.SKIP), int(Route.GIVEN)
PASS, AXES = int(Route.PASS), int(Route.AXES)


class Serial(NamedTuple):
    """The nominal arm; as in ``Pack``."""

    chains: Array  # (t, 84) C_0..C_6 with each tool
    zero: Array  # (6,) rad
    coupling: Array  # (6, 6)
    coupled: bool
    length: float  # m


@compiled(EXACT)
def choose_iterated(
    p: Serial, target: Array, route: IntArray, tool: IntArray, given: Array, near: Array,
    branch: IntArray, out: Array, first: int,
) -> int:  # fmt: skip
    """Writes the nominal joints (n, 6) rad of the targets from row ``first`` on.

    Arguments as for :func:`robotrue.compensation.branch_lanes.choose_closed`.

    Returns:
        The number of rows, or the row that Newton did not reach from the target before: the
        caller may set its route to ``GIVEN`` with joints, or to ``SKIP``, and go on.
    """
    error, pose, found = np.empty(6), np.empty(12), np.empty(6)
    axis, origin = np.empty((6, 3)), np.empty((6, 3))
    matrix, inverse = np.empty((6, 6)), np.empty((6, 6))
    for r in range(first, len(route)):
        if route[r] == SKIP:
            continue
        if route[r] == GIVEN or route[r] == PASS or route[r] == AXES:
            for k in range(6):
                found[k] = given[r, k]
        elif not iterated_joints(
            p, p.chains[tool[r]], target[r], near, error, axis, origin, pose, matrix, inverse, found
        ):
            return r
        branch[3] = 1
        for k in range(6):
            near[k] = out[r, k] = found[k]
    return len(route)


@compiled(EXACT)
def iterated_joints(
    p: Serial, c: Array, target: Array, near: Array, error: Array, axis: Array, origin: Array,
    pose: Array, matrix: Array, inverse: Array, out: Array,
) -> bool:  # fmt: skip
    """Writes nominal joints (6,) rad by Newton from ``near``; False if it does not arrive.

    Steps are held under 0.3 rad, so it stays on the branch.
    """
    angle, step, order = np.empty(6), np.empty(6), np.empty(6)
    for i in range(6):
        out[i] = near[i]
    miss = twist = np.inf
    for _ in range(40):
        for i in range(6):
            angle[i] = out[i]
        if p.coupled:
            mix(p.coupling, angle)
        for i in range(6):
            angle[i] += p.zero[i]
        chain(c, angle, axis, origin, pose)
        miss, twist = deviation(pose, target, error)
        if miss < 1e-12 and twist < 1e-12:
            return True
        jacobian(axis, origin, pose, p.length, matrix)
        if p.coupled:
            couple_rows(p.coupling, matrix)
        if not invert6(matrix, order, inverse):
            return False
        widest, scale = 0.0, 1.0 / p.length
        for i in range(6):
            total = 0.0
            for k in range(3):
                total += inverse[i, k] * error[k] * scale
                total += inverse[i, k + 3] * error[k + 3]
            step[i] = total
            widest = max(widest, abs(total))
        damp = min(1.0, 0.3 / widest) if widest > 0.0 else 1.0
        for i in range(6):
            out[i] -= damp * step[i]
        if widest < 1e-13:
            break
    return miss < 1e-9 and twist < 1e-9


@compiled(EXACT)
def chain(c: Array, angle: Array, axis: Array, origin: Array, out: Array) -> None:
    """Walks C_0 Rz C_1 ... Rz C_6: joint axes and origins (6, 3), pose of the tool (12,).

    Args:
        c: (84,) C_0..C_6.
        angle: (6,) theta in rad.
        axis: Written.
        origin: m, written.
        out: Written.
    """
    for k in range(12):
        out[k] = c[k]
    for i in range(6):
        n = 12 * (i + 1)
        s, e = math.sin(angle[i]), math.cos(angle[i])
        for k in range(3):
            x, y, z, p = out[3 * k], out[3 * k + 1], out[3 * k + 2], out[9 + k]
            axis[i, k], origin[i, k] = z, p
            x, y = e * x + s * y, e * y - s * x
            for j in range(3):
                out[3 * k + j] = x * c[n + j] + y * c[n + 3 + j] + z * c[n + 6 + j]
            out[9 + k] = p + x * c[n + 9] + y * c[n + 10] + z * c[n + 11]


@compiled(EXACT)
def jacobian(axis: Array, origin: Array, pose: Array, length: float, out: Array) -> None:
    """Writes dx/dtheta (6, 6) of the tool point, linear rows divided by ``length``."""
    scale = 1.0 / length
    for i in range(6):
        a0, a1, a2 = axis[i, 0], axis[i, 1], axis[i, 2]
        r0, r1, r2 = pose[9] - origin[i, 0], pose[10] - origin[i, 1], pose[11] - origin[i, 2]
        out[0, i] = (a1 * r2 - a2 * r1) * scale
        out[1, i] = (a2 * r0 - a0 * r2) * scale
        out[2, i] = (a0 * r1 - a1 * r0) * scale
        out[3, i], out[4, i], out[5, i] = a0, a1, a2


@compiled(EXACT)
def couple_rows(matrix: Array, rows: Array) -> None:
    """Replaces rows (6, 6) by rows @ matrix."""
    for k in range(6):
        v0, v1, v2, v3, v4, v5 = (
            rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4], rows[k, 5],
        )  # fmt: skip
        for i in range(6):
            rows[k, i] = (
                v0 * matrix[0, i] + v1 * matrix[1, i] + v2 * matrix[2, i]
                + v3 * matrix[3, i] + v4 * matrix[4, i] + v5 * matrix[5, i]
            )  # fmt: skip


@compiled(EXACT)
def mix(matrix: Array, vector: Array) -> None:
    """Replaces a vector (6,) by matrix @ vector."""
    v0, v1, v2, v3, v4, v5 = vector[0], vector[1], vector[2], vector[3], vector[4], vector[5]
    for i in range(6):
        vector[i] = (
            matrix[i, 0] * v0 + matrix[i, 1] * v1 + matrix[i, 2] * v2
            + matrix[i, 3] * v3 + matrix[i, 4] * v4 + matrix[i, 5] * v5
        )  # fmt: skip


@compiled(EXACT)
def invert6(matrix: Array, order: Array, out: Array) -> bool:
    """Writes the inverse of a 6x6 matrix (Gauss-Jordan in place, row pivots); False if singular."""
    for i in range(6):
        for j in range(6):
            out[i, j] = matrix[i, j]
    for k in range(6):
        pivot = k
        for i in range(k + 1, 6):
            if abs(out[i, k]) > abs(out[pivot, k]):
                pivot = i
        order[k] = pivot
        if not abs(out[pivot, k]) > 1e-13:
            return False
        if pivot != k:
            for j in range(6):
                out[k, j], out[pivot, j] = out[pivot, j], out[k, j]
        scale = 1.0 / out[k, k]
        out[k, k] = 1.0
        r0, r1, r2 = out[k, 0] * scale, out[k, 1] * scale, out[k, 2] * scale
        r3, r4, r5 = out[k, 3] * scale, out[k, 4] * scale, out[k, 5] * scale
        for i in range(6):
            f = out[i, k]
            out[i, k] = 0.0
            out[i, 0] -= f * r0
            out[i, 1] -= f * r1
            out[i, 2] -= f * r2
            out[i, 3] -= f * r3
            out[i, 4] -= f * r4
            out[i, 5] -= f * r5
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5] = r0, r1, r2, r3, r4, r5
    for j in range(6):
        k = 5 - j
        pivot = int(order[k])
        if pivot != k:
            for i in range(6):
                out[i, k], out[i, pivot] = out[i, pivot], out[i, k]
    return True


@compiled(EXACT)
def deviation(pose: Array, target: Array, out: Array) -> tuple[float, float]:
    """Writes pose minus target as (6,) m, sine of the rotation vector; returns both lengths."""
    for i in range(3):
        out[i] = pose[9 + i] - target[9 + i]
    x = y = z = 0.0
    for j in range(3):
        x += pose[6 + j] * target[3 + j] - pose[3 + j] * target[6 + j]
        y += pose[j] * target[6 + j] - pose[6 + j] * target[j]
        z += pose[3 + j] * target[j] - pose[j] * target[3 + j]
    trace = 0.0
    for j in range(9):
        trace += pose[j] * target[j]
    out[3], out[4], out[5] = 0.5 * x, 0.5 * y, 0.5 * z
    turn = 0.5 * math.sqrt(x * x + y * y + z * z)
    if trace < 1.0:  # more than a quarter turn: keep the step long enough to get there
        scale = math.atan2(turn, 0.5 * (trace - 1.0)) / max(turn, 1e-6)
        out[3] *= scale
        out[4] *= scale
        out[5] *= scale
        turn *= scale
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]), turn
