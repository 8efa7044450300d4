"""Inversion of the calibrated arm for many targets abreast; rows as in ``arm_lanes``.

Chord Newton: the normal equations of the Jacobian at the nominal joints serve for all steps.
Lanes that are nearly singular or do not arrive are left to
:mod:`robotrue.compensation.stragglers`. SI, base frame. The machine code of this file contains
that of ``arm_lanes``: after editing it, clear ``__pycache__``.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.arm_lanes import evaluate, jacobian
from robotrue.compensation.compiled import EXACT, compiled
from robotrue.compensation.memory import (
    APPROACH,
    CENTRE,
    ERROR,
    JOINTS,
    LANES,
    MASS,
    NORMAL,
    PIVOT,
    PULL,
    SHIFT,
    SMOOTH_AT,
    START,
    STEP,
    TARGET,
    TOLD_SHIFT,
    TOLD_TURN,
    TOOL,
    TRACE,
    TURN,
    WRENCH,
    Aim,
    Arm,
    Asked,
    Space,
)
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray

L = LANES
ROUNDS = 4  # steps before a lane is a straggler; two are the rule

AXES = int(Route.AXES)
DONE, LOST = int(Status.COMPENSATED), int(Status.UNCHANGED_NOT_CONVERGED)
UNREACHABLE = int(Status.UNCHANGED_UNREACHABLE)
SINGULAR, WRIST = int(Status.UNCHANGED_SINGULAR), int(Status.UNCHANGED_WRIST_SINGULAR)
STRAGGLER = -1  # not a status: to be solved one by one
WEAK = 1e-3  # smallest singular value at which the normal equations keep ten digits


@compiled(EXACT, borrows=True)
def _deviation(chain: Array, lane: Array, work: Array, size: int) -> None:
    """Writes tool minus target: (6 rows) m, sine of the rotation vector; and both lengths.

    Lanes more than a quarter turn away get an infinite turn.
    """
    for n in range(L):
        d0 = chain[(TOOL + 9) * L + n] - lane[(TARGET + 9) * L + n]
        d1 = chain[(TOOL + 10) * L + n] - lane[(TARGET + 10) * L + n]
        d2 = chain[(TOOL + 11) * L + n] - lane[(TARGET + 11) * L + n]
        a0, a1, a2 = chain[TOOL * L + n], chain[(TOOL + 1) * L + n], chain[(TOOL + 2) * L + n]
        b0, b1, b2 = lane[TARGET * L + n], lane[(TARGET + 1) * L + n], lane[(TARGET + 2) * L + n]
        x, y, z = b1 * a2 - b2 * a1, b2 * a0 - b0 * a2, b0 * a1 - b1 * a0
        trace = a0 * b0 + a1 * b1 + a2 * b2
        a0, a1, a2 = (
            chain[(TOOL + 3) * L + n], chain[(TOOL + 4) * L + n], chain[(TOOL + 5) * L + n],
        )  # fmt: skip
        b0, b1, b2 = (
            lane[(TARGET + 3) * L + n], lane[(TARGET + 4) * L + n], lane[(TARGET + 5) * L + n],
        )  # fmt: skip
        x += b1 * a2 - b2 * a1
        y += b2 * a0 - b0 * a2
        z += b0 * a1 - b1 * a0
        trace += a0 * b0 + a1 * b1 + a2 * b2
        a0, a1, a2 = (
            chain[(TOOL + 6) * L + n], chain[(TOOL + 7) * L + n], chain[(TOOL + 8) * L + n],
        )  # fmt: skip
        b0, b1, b2 = (
            lane[(TARGET + 6) * L + n], lane[(TARGET + 7) * L + n], lane[(TARGET + 8) * L + n],
        )  # fmt: skip
        x += b1 * a2 - b2 * a1
        y += b2 * a0 - b0 * a2
        z += b0 * a1 - b1 * a0
        trace += a0 * b0 + a1 * b1 + a2 * b2
        work[ERROR * L + n], work[(ERROR + 1) * L + n], work[(ERROR + 2) * L + n] = d0, d1, d2
        work[(ERROR + 3) * L + n] = 0.5 * x
        work[(ERROR + 4) * L + n] = 0.5 * y
        work[(ERROR + 5) * L + n] = 0.5 * z
        turn = 0.5 * math.sqrt(x * x + y * y + z * z)
        work[size * L + n] = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        work[(size + 1) * L + n] = turn if trace >= 1.0 else np.inf


@compiled(EXACT, borrows=True)
def _normal_matrix(matrix: Array) -> None:
    """Writes the lower triangle of J^T J: row ``NORMAL + 6 i + j`` for j <= i."""
    for i in range(6):
        for j in range(i + 1):
            for n in range(L):
                total = matrix[i * L + n] * matrix[j * L + n]
                for k in range(1, 6):
                    total += matrix[(6 * k + i) * L + n] * matrix[(6 * k + j) * L + n]
                matrix[(NORMAL + 6 * i + j) * L + n] = total


@compiled(EXACT, borrows=True)
def _factor(matrix: Array, root: Array) -> None:
    """Replaces J^T J by its lower factor, below the diagonal; and writes the least pivot.

    ``root`` (6 rows) gets the inverse of the factor's diagonal. No pivot needs choosing in a
    positive definite matrix, so all lanes do the same; written out, so that they do it at once.
    """
    N, R = NORMAL * L, root
    for n in range(L):
        d0 = matrix[N + n]
        r0 = 1.0 / math.sqrt(d0)
        a1, a2, a3 = (
            matrix[N + 6 * L + n] * r0, matrix[N + 12 * L + n] * r0, matrix[N + 18 * L + n] * r0,
        )  # fmt: skip
        a4, a5 = matrix[N + 24 * L + n] * r0, matrix[N + 30 * L + n] * r0
        d1 = matrix[N + 7 * L + n] - a1 * a1
        r1 = 1.0 / math.sqrt(d1)
        b2 = (matrix[N + 13 * L + n] - a2 * a1) * r1
        b3 = (matrix[N + 19 * L + n] - a3 * a1) * r1
        b4 = (matrix[N + 25 * L + n] - a4 * a1) * r1
        b5 = (matrix[N + 31 * L + n] - a5 * a1) * r1
        d2 = matrix[N + 14 * L + n] - a2 * a2 - b2 * b2
        r2 = 1.0 / math.sqrt(d2)
        c3 = (matrix[N + 20 * L + n] - a3 * a2 - b3 * b2) * r2
        c4 = (matrix[N + 26 * L + n] - a4 * a2 - b4 * b2) * r2
        c5 = (matrix[N + 32 * L + n] - a5 * a2 - b5 * b2) * r2
        d3 = matrix[N + 21 * L + n] - a3 * a3 - b3 * b3 - c3 * c3
        r3 = 1.0 / math.sqrt(d3)
        e4 = (matrix[N + 27 * L + n] - a4 * a3 - b4 * b3 - c4 * c3) * r3
        e5 = (matrix[N + 33 * L + n] - a5 * a3 - b5 * b3 - c5 * c3) * r3
        d4 = matrix[N + 28 * L + n] - a4 * a4 - b4 * b4 - c4 * c4 - e4 * e4
        r4 = 1.0 / math.sqrt(d4)
        f5 = (matrix[N + 34 * L + n] - a5 * a4 - b5 * b4 - c5 * c4 - e5 * e4) * r4
        d5 = matrix[N + 35 * L + n] - a5 * a5 - b5 * b5 - c5 * c5 - e5 * e5 - f5 * f5
        matrix[N + 6 * L + n], matrix[N + 12 * L + n], matrix[N + 18 * L + n] = a1, a2, a3
        matrix[N + 24 * L + n], matrix[N + 30 * L + n] = a4, a5
        matrix[N + 13 * L + n], matrix[N + 19 * L + n] = b2, b3
        matrix[N + 25 * L + n], matrix[N + 31 * L + n] = b4, b5
        matrix[N + 20 * L + n], matrix[N + 26 * L + n], matrix[N + 32 * L + n] = c3, c4, c5
        matrix[N + 27 * L + n], matrix[N + 33 * L + n], matrix[N + 34 * L + n] = e4, e5, f5
        R[n], R[L + n], R[2 * L + n], R[3 * L + n] = r0, r1, r2, r3
        R[4 * L + n], R[5 * L + n] = r4, 1.0 / math.sqrt(d5)
        least = d0
        least = d1 if not d1 >= least else least
        least = d2 if not d2 >= least else least
        least = d3 if not d3 >= least else least
        least = d4 if not d4 >= least else least
        matrix[PIVOT * L + n] = d5 if not d5 >= least else least


@compiled(EXACT, borrows=True)
def _invert_factor(matrix: Array, root: Array) -> None:
    """Replaces the factor by its inverse W, (J^T J)^-1 = W^T W, and writes the trace of that.

    The trace is the squared norm of the inverse of J.
    """
    N, R = NORMAL * L, root
    for n in range(L):
        r0, r1, r2, r3 = R[n], R[L + n], R[2 * L + n], R[3 * L + n]
        r4, r5 = R[4 * L + n], R[5 * L + n]
        l21, l32, l43 = matrix[N + 13 * L + n], matrix[N + 20 * L + n], matrix[N + 27 * L + n]
        l31, l42, l53 = matrix[N + 19 * L + n], matrix[N + 26 * L + n], matrix[N + 33 * L + n]
        l41, l52 = matrix[N + 25 * L + n], matrix[N + 32 * L + n]
        l51, l54 = matrix[N + 31 * L + n], matrix[N + 34 * L + n]
        l20, l30 = matrix[N + 12 * L + n], matrix[N + 18 * L + n]
        l40, l50 = matrix[N + 24 * L + n], matrix[N + 30 * L + n]
        a1 = -r1 * (matrix[N + 6 * L + n] * r0)
        a2 = -r2 * (l20 * r0 + l21 * a1)
        a3 = -r3 * (l30 * r0 + l31 * a1 + l32 * a2)
        a4 = -r4 * (l40 * r0 + l41 * a1 + l42 * a2 + l43 * a3)
        a5 = -r5 * (l50 * r0 + l51 * a1 + l52 * a2 + l53 * a3 + l54 * a4)
        b2 = -r2 * (l21 * r1)
        b3 = -r3 * (l31 * r1 + l32 * b2)
        b4 = -r4 * (l41 * r1 + l42 * b2 + l43 * b3)
        b5 = -r5 * (l51 * r1 + l52 * b2 + l53 * b3 + l54 * b4)
        c3 = -r3 * (l32 * r2)
        c4 = -r4 * (l42 * r2 + l43 * c3)
        c5 = -r5 * (l52 * r2 + l53 * c3 + l54 * c4)
        e4 = -r4 * (l43 * r3)
        e5 = -r5 * (l53 * r3 + l54 * e4)
        f5 = -r5 * (l54 * r4)
        matrix[N + n], matrix[N + 7 * L + n], matrix[N + 14 * L + n] = r0, r1, r2
        matrix[N + 21 * L + n], matrix[N + 28 * L + n], matrix[N + 35 * L + n] = r3, r4, r5
        matrix[N + 6 * L + n], matrix[N + 12 * L + n], matrix[N + 18 * L + n] = a1, a2, a3
        matrix[N + 24 * L + n], matrix[N + 30 * L + n] = a4, a5
        matrix[N + 13 * L + n], matrix[N + 19 * L + n] = b2, b3
        matrix[N + 25 * L + n], matrix[N + 31 * L + n] = b4, b5
        matrix[N + 20 * L + n], matrix[N + 26 * L + n], matrix[N + 32 * L + n] = c3, c4, c5
        matrix[N + 27 * L + n], matrix[N + 33 * L + n], matrix[N + 34 * L + n] = e4, e5, f5
        trace = r0 * r0 + r1 * r1 + r2 * r2 + r3 * r3 + r4 * r4 + r5 * r5
        trace += a1 * a1 + a2 * a2 + a3 * a3 + a4 * a4 + a5 * a5
        trace += b2 * b2 + b3 * b3 + b4 * b4 + b5 * b5
        matrix[TRACE * L + n] = trace + c3 * c3 + c4 * c4 + c5 * c5 + e4 * e4 + e5 * e5 + f5 * f5


@compiled(EXACT, borrows=True)
def _step(a: Arm, matrix: Array, work: Array) -> None:
    """Writes the chord step (6 rows) rad: (J^T J)^-1 J^T error."""
    scale = 1.0 / a.length
    for i in range(6):
        for n in range(L):
            linear = matrix[i * L + n] * work[ERROR * L + n]
            linear += matrix[(6 + i) * L + n] * work[(ERROR + 1) * L + n]
            linear += matrix[(12 + i) * L + n] * work[(ERROR + 2) * L + n]
            total = linear * scale + matrix[(18 + i) * L + n] * work[(ERROR + 3) * L + n]
            total += matrix[(24 + i) * L + n] * work[(ERROR + 4) * L + n]
            work[(PULL + i) * L + n] = total + matrix[(30 + i) * L + n] * work[(ERROR + 5) * L + n]
    N, P, S = NORMAL * L, PULL * L, STEP * L
    for n in range(L):
        p0, p1, p2 = work[P + n], work[P + L + n], work[P + 2 * L + n]
        p3, p4, p5 = work[P + 3 * L + n], work[P + 4 * L + n], work[P + 5 * L + n]
        w0, w1, w2 = matrix[N + 30 * L + n], matrix[N + 31 * L + n], matrix[N + 32 * L + n]
        w3, w4, w5 = matrix[N + 33 * L + n], matrix[N + 34 * L + n], matrix[N + 35 * L + n]
        y = w0 * p0 + w1 * p1 + w2 * p2 + w3 * p3 + w4 * p4 + w5 * p5
        x0, x1, x2, x3, x4, x5 = w0 * y, w1 * y, w2 * y, w3 * y, w4 * y, w5 * y
        w0, w1, w2 = matrix[N + 24 * L + n], matrix[N + 25 * L + n], matrix[N + 26 * L + n]
        w3, w4 = matrix[N + 27 * L + n], matrix[N + 28 * L + n]
        y = w0 * p0 + w1 * p1 + w2 * p2 + w3 * p3 + w4 * p4
        x0, x1, x2, x3, x4 = x0 + w0 * y, x1 + w1 * y, x2 + w2 * y, x3 + w3 * y, x4 + w4 * y
        w0, w1 = matrix[N + 18 * L + n], matrix[N + 19 * L + n]
        w2, w3 = matrix[N + 20 * L + n], matrix[N + 21 * L + n]
        y = w0 * p0 + w1 * p1 + w2 * p2 + w3 * p3
        x0, x1, x2, x3 = x0 + w0 * y, x1 + w1 * y, x2 + w2 * y, x3 + w3 * y
        w0, w1, w2 = matrix[N + 12 * L + n], matrix[N + 13 * L + n], matrix[N + 14 * L + n]
        y = w0 * p0 + w1 * p1 + w2 * p2
        x0, x1, x2 = x0 + w0 * y, x1 + w1 * y, x2 + w2 * y
        w0, w1 = matrix[N + 6 * L + n], matrix[N + 7 * L + n]
        y = w0 * p0 + w1 * p1
        x0, x1 = x0 + w0 * y, x1 + w1 * y
        w0 = matrix[N + n]
        work[S + n], work[S + L + n], work[S + 2 * L + n] = x0 + w0 * (w0 * p0), x1, x2
        work[S + 3 * L + n], work[S + 4 * L + n], work[S + 5 * L + n] = x3, x4, x5


@compiled(EXACT, borrows=True)
def _gather(a: Arm, r: Asked, rows: IntArray, first: int, lane: Array, work: Array) -> int:
    """Fills the lanes with rows[first:]; lanes left over repeat the last. Returns how many."""
    count = min(L, len(rows) - first)
    for n in range(L):
        i = rows[first + min(n, count - 1)]
        for j in range(3):  # columns of the rotation one after the other, then the position
            for k in range(3):
                lane[(TARGET + 3 * j + k) * L + n] = r.target[i, 3 * k + j]
            lane[(TARGET + 9 + j) * L + n] = r.target[i, 9 + j]
        for k in range(6):
            lane[(START + k) * L + n] = r.nominal[i, k]
            lane[(APPROACH + k) * L + n] = r.approach[i, k]
            lane[(WRENCH + k) * L + n] = r.wrench[i if r.wrench.shape[0] > 1 else 0, k]
        lane[MASS * L + n] = r.mass[i if r.mass.shape[0] > 1 else 0]
        c = i if r.com.shape[0] > 1 else 0
        for k in range(3):
            total = a.flange[9 + k]
            for j in range(3):
                total += a.flange[3 * k + j] * r.com[c, j]
            lane[(CENTRE + k) * L + n] = total
        for k in range(6):
            work[(JOINTS + k) * L + n] = lane[(START + k) * L + n]
            work[(SMOOTH_AT + k) * L + n] = np.inf
    return count


@compiled(EXACT, borrows=True)
def correct(a: Arm, g: Aim, r: Asked, rows: IntArray, s: Space) -> None:
    """Inverts the arm for the rows given, all with one tool; writes into ``r``."""
    work, lane = s.work, s.lane
    for first in range(0, len(rows), L):
        count = _gather(a, r, rows, first, lane, work)
        evaluate(a, s, g.reuse)
        _take_axes(r, rows, first, count, s.told, lane)
        _deviation(s.told, lane, work, TOLD_SHIFT)
        _deviation(s.real, lane, work, SHIFT)
        jacobian(a, s.real, s.matrix, s.spare)
        _normal_matrix(s.matrix)
        _factor(s.matrix, s.spare)
        _invert_factor(s.matrix, s.spare)
        left = _begin(g, r, rows, first, count, s)
        for _ in range(ROUNDS):
            if left == 0:
                break
            _step(a, s.matrix, work)
            for i in range(6):
                for n in range(L):
                    old = work[(JOINTS + i) * L + n]
                    new = old - work[(STEP + i) * L + n]
                    work[(JOINTS + i) * L + n] = new if s.open[n] == 1.0 else old
            evaluate(a, s, g.reuse)
            _deviation(s.real, lane, work, SHIFT)
            left = _review(g, r, rows, first, count, s)
        _scatter(r, rows, first, count, s.work, s.told)


@compiled(EXACT, borrows=True)
def _take_axes(r: Asked, rows: IntArray, first: int, count: int, told: Array, lane: Array) -> None:
    """Makes the nominal pose the target where axes were given."""
    for n in range(count):
        i = rows[first + n]
        if r.route[i] == AXES:
            for k in range(12):
                lane[(TARGET + k) * L + n] = told[(TOOL + k) * L + n]
            for j in range(3):
                for k in range(3):
                    r.target[i, 3 * k + j] = told[(TOOL + 3 * j + k) * L + n]
                r.target[i, 9 + j] = told[(TOOL + 9 + j) * L + n]


@compiled(EXACT, borrows=True)
def _wrist_sine(told: Array, n: int) -> float:
    """Returns the sine between axes 4 and 6 of the nominal arm."""
    a, b = (36 + 6) * L + n, (60 + 6) * L + n
    x = told[a + L] * told[b + 2 * L] - told[a + 2 * L] * told[b + L]
    y = told[a + 2 * L] * told[b] - told[a] * told[b + 2 * L]
    z = told[a] * told[b + L] - told[a + L] * told[b]
    return math.sqrt(x * x + y * y + z * z)


@compiled(EXACT, borrows=True)
def _begin(g: Aim, r: Asked, rows: IntArray, first: int, count: int, s: Space) -> int:
    """Writes error and posture at the nominal joints; returns how many lanes need a step."""
    work, told, left = s.work, s.told, 0
    for n in range(L):
        s.open[n] = 0.0
    for n in range(count):
        i = rows[first + n]
        if not (work[TOLD_SHIFT * L + n] < 1e-7 and work[TOLD_TURN * L + n] < 1e-7):
            r.code[i] = UNREACHABLE
            continue
        for k in range(3):
            r.before[i, k] = r.after[i, k] = work[(ERROR + k) * L + n]
        singular = 1.0 / math.sqrt(s.matrix[TRACE * L + n])
        weak = not (s.matrix[PIVOT * L + n] > WEAK * WEAK and singular > WEAK)
        if weak or not work[(SHIFT + 1) * L + n] < 1.0:
            r.code[i] = STRAGGLER
            continue
        r.singular[i] = singular
        if _wrist_sine(told, n) < g.min_wrist_sine:
            r.code[i] = WRIST
        elif singular < g.min_singular_value:
            r.code[i] = SINGULAR
        elif work[SHIFT * L + n] < g.tolerance and work[TURN * L + n] < g.turn_tolerance:
            r.code[i] = DONE
        else:
            r.code[i] = STRAGGLER
            s.open[n] = 1.0
            left += 1
    return left


@compiled(EXACT, borrows=True)
def _review(g: Aim, r: Asked, rows: IntArray, first: int, count: int, s: Space) -> int:
    """Closes the lanes that have arrived; returns how many have not."""
    left = 0
    for n in range(count):
        if s.open[n] == 0.0:
            continue
        i = rows[first + n]
        for k in range(3):
            r.after[i, k] = s.work[(ERROR + k) * L + n]
        if s.work[SHIFT * L + n] < g.tolerance and s.work[TURN * L + n] < g.turn_tolerance:
            r.code[i] = DONE
            s.open[n] = 0.0
        else:
            left += 1
    return left


@compiled(EXACT, borrows=True)
def _scatter(r: Asked, rows: IntArray, first: int, count: int, work: Array, told: Array) -> None:
    """Writes joints and command of the lanes: all at once, a call per lane costs more than it."""
    for n in range(count):
        i = rows[first + n]
        for k in range(6):
            r.found[i, k] = work[(JOINTS + k) * L + n]
        for j in range(3):
            for k in range(3):
                r.told[i, 3 * k + j] = told[(TOOL + 3 * j + k) * L + n]
            r.told[i, 9 + j] = told[(TOOL + 9 + j) * L + n]


@compiled(EXACT, borrows=True)
def look(
    a: Arm, r: Asked, rows: IntArray, joints: Array, s: Space, real: Array, matrix: Array,
    wrist: Array,
) -> None:  # fmt: skip
    """Writes what stragglers need at ``joints`` (k, 6) of ``rows`` (k,).

    The command goes to ``r.told``; ``real`` (k, 12) actual poses, ``matrix`` (k, 6, 6) Jacobians,
    ``wrist`` (k,) sine between axes 4 and 6.
    """
    for first in range(0, len(rows), L):
        count = _gather(a, r, rows, first, s.lane, s.work)
        for n in range(L):
            for k in range(6):
                s.work[(JOINTS + k) * L + n] = joints[first + min(n, count - 1), k]
        evaluate(a, s, 0.0)
        jacobian(a, s.real, s.matrix, s.spare)
        _scatter(r, rows, first, count, s.work, s.told)
        for n in range(count):
            i = first + n
            for j in range(3):
                for k in range(3):
                    real[i, 3 * k + j] = s.real[(TOOL + 3 * j + k) * L + n]
                real[i, 9 + j] = s.real[(TOOL + 9 + j) * L + n]
            for k in range(36):
                matrix[i, k // 6, k % 6] = s.matrix[k * L + n]
            wrist[i] = _wrist_sine(s.told, n)
