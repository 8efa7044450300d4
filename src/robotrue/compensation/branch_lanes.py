"""Nominal joints of straight runs: the closed form of ``branches`` for many targets abreast.

A straight move keeps the arm on the branch it came on, so a run of them needs one solution each,
not eight, and no trigonometric function but the arc tangents of its joints. A target that is not
near the one before, or stands at an edge of the form (arm stretched, wrist stretched), is solved by
``branches`` alone. What a target gets depends on the target before it only through the branch and
the turn, never on how the run is cut. Rows of LANES numbers as in ``arm_lanes``.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.branches import NEAR, Closed, closed_joints, mix
from robotrue.compensation.memory import LANES
from robotrue.compensation.status import Route
from robotrue.core.arrays import Array, IntArray
from robotrue.core.compiled import EXACT, compiled
from robotrue.core.sines import arc_tangents

L = LANES
SKIP, LINEAR = int(Route.SKIP), int(Route.LINEAR)
GIVEN, PASS, AXES = int(Route.GIVEN), int(Route.PASS), int(Route.AXES)
TURN = 2.0 * math.pi
STRETCHED = 1e-9  # sine of joint 5 below which only theta 4 + 6 exists
# Rows of the work space: the hand, then sines, then cosines, then the joints.
HAND, SINE, COSINE, ANGLE, GOOD = 0, 12, 18, 24, 30
ROWS = 31


@compiled(EXACT)
def choose_closed(
    p: Closed, target: Array, route: IntArray, tool: IntArray, given: Array, near: Array,
    branch: IntArray, out: Array,
) -> None:  # fmt: skip
    """Writes the nominal joints (n, 6) rad of the targets in order; NaN where there are none.

    Args:
        p: The arm.
        target: (n, 12) in base.
        route: (n,) :class:`Route`.
        tool: (n,).
        given: (n, 6) rad, joints where the route has them.
        near: (6,) rad, where the arm is before; renewed.
        branch: (4,) shoulder, elbow, flip of the target before (0 unknown), and 1 once the arm
            has been anywhere; renewed.
        out: (n, 6) rad, written.
    """
    theta, trial, hand = np.empty(6), np.empty(6), np.empty(12)
    found, work = np.empty(6), np.zeros(ROWS * L)
    r, last, count = 0, len(route), 0
    while r < last:
        if route[r] == LINEAR and branch[0] != 0 and branch[3] != 0:
            count = 1
            while (
                count < L
                and r + count < last
                and (route[r + count] == LINEAR and tool[r + count] == tool[r])
            ):
                count += 1
            _abreast(p, tool[r], target, r, count, branch, work)
            r += _accept(p, tool[r], target, r, count, near, branch, theta, trial, hand, work, out)
            continue
        r += 1
        if route[r - 1] == SKIP:
            continue
        if route[r - 1] == GIVEN or route[r - 1] == PASS or route[r - 1] == AXES:
            for k in range(6):
                found[k] = given[r - 1, k]
            branch[0] = 0
        else:
            settle = route[r - 1] != LINEAR or branch[3] == 0
            if not closed_joints(
                p, tool[r - 1], target[r - 1], near, settle, branch, theta, trial, hand, found
            ):
                continue
        branch[3] = 1
        for k in range(6):
            near[k] = out[r - 1, k] = found[k]


@compiled(EXACT)
def _accept(
    p: Closed, tool: int, target: Array, first: int, count: int, near: Array, branch: IntArray,
    theta: Array, trial: Array, hand: Array, work: Array, out: Array,
) -> int:  # fmt: skip
    """Takes the joints of the lanes in order, at the turn nearest to the target before.

    Returns how many rows are done: all, or those up to one that went to another branch.
    """
    found = np.empty(6)
    shoulder, elbow, flip = branch[0], branch[1], branch[2]
    for n in range(count):
        r = first + n
        good = work[GOOD * L + n] == 1.0
        if good:
            for i in range(6):
                found[i] = work[(ANGLE + i) * L + n]
            if p.coupled:
                mix(p.uncoupling, found)
            widest = 0.0
            for i in range(6):
                if not abs(near[i] - found[i]) < 3.1:
                    found[i] += TURN * math.floor((near[i] - found[i]) / TURN + 0.5)
                widest = max(widest, abs(found[i] - near[i]))
            good = widest < NEAR
        if not good and not closed_joints(
            p, tool, target[r], near, False, branch, theta, trial, hand, found
        ):
            continue
        for k in range(6):
            near[k] = out[r, k] = found[k]
        if branch[0] != shoulder or branch[1] != elbow or branch[2] != flip:
            return n + 1
    return count


@compiled(EXACT, borrows=True)
def _abreast(
    p: Closed, tool: int, target: Array, first: int, count: int, branch: IntArray, work: Array
) -> None:
    """Writes the joints (6 rows) rad of one branch, at any turn, and whether they are good."""
    _hands(p.end, tool, target, first, count, work)
    _arms(p.lengths, float(branch[0]), float(branch[1]), work)
    _wrists(float(branch[2]), work)
    arc_tangents(work, SINE * L, COSINE * L, 6 * L, ANGLE * L)
    for i in range(6):
        sign, offset = p.sign[i], p.offset[i]
        for n in range(L):
            work[(ANGLE + i) * L + n] = sign * (work[(ANGLE + i) * L + n] - offset)


@compiled(EXACT, borrows=True)
def _hands(end: Array, tool: int, target: Array, first: int, count: int, work: Array) -> None:
    """Writes the wrist flange in base (12 rows); lanes left over repeat the last."""
    e0, e1, e2, e3, e4, e5 = (
        end[tool, 0], end[tool, 1], end[tool, 2], end[tool, 3], end[tool, 4], end[tool, 5],
    )  # fmt: skip
    e6, e7, e8, e9, e10, e11 = (
        end[tool, 6], end[tool, 7], end[tool, 8], end[tool, 9], end[tool, 10], end[tool, 11],
    )  # fmt: skip
    for n in range(L):
        r = first + min(n, count - 1)
        for i in range(3):
            a, b, c = target[r, 3 * i], target[r, 3 * i + 1], target[r, 3 * i + 2]
            work[(HAND + 3 * i) * L + n] = a * e0 + b * e3 + c * e6
            work[(HAND + 3 * i + 1) * L + n] = a * e1 + b * e4 + c * e7
            work[(HAND + 3 * i + 2) * L + n] = a * e2 + b * e5 + c * e8
            work[(HAND + 9 + i) * L + n] = target[r, 9 + i] + a * e9 + b * e10 + c * e11


@compiled(EXACT, borrows=True)
def _arms(g: Array, shoulder: float, elbow: float, work: Array) -> None:
    """Writes sine and cosine of theta 1, 2, 3 and 2 + 3 (the last in the rows of 4)."""
    a1, a2, b = g[0], g[1], g[2]
    c1, c2, c3, c4 = g[3], g[4], g[5], g[6]
    fore2 = a2 * a2 + c3 * c3
    fore = math.sqrt(fore2)
    sine_g, cosine_g = a2 / fore, c3 / fore
    H, S, C = HAND * L, SINE * L, COSINE * L
    for n in range(L):
        x = work[H + 9 * L + n] - c4 * work[H + 2 * L + n]
        y = work[H + 10 * L + n] - c4 * work[H + 5 * L + n]
        z = work[H + 11 * L + n] - c4 * work[H + 8 * L + n]
        flat2 = x * x + y * y
        ahead = shoulder * math.sqrt(flat2 - b * b)
        work[S + n] = (y * ahead - x * b) / flat2
        work[C + n] = (x * ahead + y * b) / flat2
        nx, nz = ahead - a1, z - c1
        s2 = nx * nx + nz * nz
        s = math.sqrt(s2)
        cosine_l = (s2 + c2 * c2 - fore2) / (2.0 * s * c2)
        cosine_b = (s2 - c2 * c2 - fore2) / (2.0 * c2 * fore)
        sine_l = elbow * math.sqrt((1.0 - cosine_l) * (1.0 + cosine_l))
        sine_b = elbow * math.sqrt((1.0 - cosine_b) * (1.0 + cosine_b))
        nx, nz = nx / s, nz / s
        s2nd, c2nd = nx * cosine_l - nz * sine_l, nz * cosine_l + nx * sine_l
        s3rd, c3rd = sine_b * cosine_g - cosine_b * sine_g, cosine_b * cosine_g + sine_b * sine_g
        work[S + L + n], work[C + L + n] = s2nd, c2nd
        work[S + 2 * L + n], work[C + 2 * L + n] = s3rd, c3rd
        work[S + 3 * L + n] = s2nd * c3rd + c2nd * s3rd
        work[C + 3 * L + n] = c2nd * c3rd - s2nd * s3rd
        good = flat2 > b * b and abs(cosine_l) < 1.0 and abs(cosine_b) < 1.0
        work[GOOD * L + n] = 1.0 if good else 0.0


@compiled(EXACT, borrows=True)
def _wrists(flip: float, work: Array) -> None:
    """Writes sine and cosine of theta 4, 5 and 6, all times the sine of theta 5 but for 5 itself.

    They are rows and columns of (Rz(theta1) Ry(theta2 + theta3))^T times the hand.
    """
    H, S, C = HAND * L, SINE * L, COSINE * L
    for n in range(L):
        s1, e1 = work[S + n], work[C + n]
        s23, e23 = work[S + 3 * L + n], work[C + 3 * L + n]
        ahead = e1 * work[H + 2 * L + n] + s1 * work[H + 5 * L + n]
        m13 = e23 * ahead - s23 * work[H + 8 * L + n]
        m23 = e1 * work[H + 5 * L + n] - s1 * work[H + 2 * L + n]
        m33 = s23 * ahead + e23 * work[H + 8 * L + n]
        m31 = s23 * (e1 * work[H + n] + s1 * work[H + 3 * L + n]) + e23 * work[H + 6 * L + n]
        m32 = e1 * work[H + L + n] + s1 * work[H + 4 * L + n]
        m32 = s23 * m32 + e23 * work[H + 7 * L + n]
        sine5 = math.sqrt(m13 * m13 + m23 * m23)
        work[S + 3 * L + n], work[C + 3 * L + n] = flip * m23, flip * m13
        work[S + 4 * L + n], work[C + 4 * L + n] = flip * sine5, m33
        work[S + 5 * L + n], work[C + 5 * L + n] = flip * m32, -flip * m31
        work[GOOD * L + n] = work[GOOD * L + n] if sine5 > STRETCHED else 0.0
