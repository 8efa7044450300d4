"""Kernels for the nominal joints of one target: closed form where the arm allows it.

Source of the closed form: Brandstoetter, Angerer, Hofbaur 2014, eq. 1-16, with the parameters of
:class:`robotrue.robot.opw.OpwGeometry`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robotrue.compensation.compiled import EXACT, compiled
from robotrue.core.arrays import Array, IntArray

TURN = 2.0 * math.pi
NEAR = 0.3  # rad: a step so small cannot lead to another branch
OUTSIDE = 1e6  # rad^2 added to the distance of a solution beyond a joint limit


class Closed(NamedTuple):
    """What the closed form knows of the nominal arm; as in ``Pack``."""

    lengths: Array  # (7,) m
    sign: Array  # (6,)
    offset: Array  # (6,) rad
    end: Array  # (t, 12)
    uncoupling: Array  # (6, 6)
    coupled: bool
    limits: Array  # (6, 2) rad


@compiled(EXACT, borrows=True)
def place(pose: Array, row: int, pose_in: Array, out: Array) -> None:
    """Writes the product of a pose (12,) and row ``row`` of poses (k, 12)."""
    for i in range(3):
        a, b, c = pose[3 * i], pose[3 * i + 1], pose[3 * i + 2]
        for j in range(3):
            out[3 * i + j] = a * pose_in[row, j] + b * pose_in[row, 3 + j] + c * pose_in[row, 6 + j]
        out[9 + i] = pose[9 + i] + a * pose_in[row, 9] + b * pose_in[row, 10] + c * pose_in[row, 11]


@compiled(EXACT, borrows=True)
def closed_branch(
    g: Array, hand: Array, shoulder: int, elbow: int, flip: int, turn4: float, out: Array
) -> bool:
    """Writes theta_opw (6,) rad of one of the eight branches; False if it does not exist.

    Args:
        g: (7,) a1, a2, b, c1, c2, c3, c4 in m.
        hand: (12,) wrist flange in base, z along axis 6.
        shoulder: +1 facing the target, -1 reaching over the back.
        elbow: +1 or -1, the two sides of the elbow.
        flip: +1 or -1, sign of theta 5.
        turn4: rad, theta 4 to take where the wrist is stretched and only theta 4 + 6 exists.
        out: (6,) written.
    """
    cx = hand[9] - g[6] * hand[2]
    cy = hand[10] - g[6] * hand[5]
    cz = hand[11] - g[6] * hand[8]
    squared = cx * cx + cy * cy - g[2] * g[2]
    if squared < 0.0:
        return False
    ahead = shoulder * math.sqrt(squared)
    out[0] = math.atan2(cy, cx) - math.atan2(g[2], ahead)
    nx, nz = ahead - g[0], cz - g[3]
    fore2 = g[1] * g[1] + g[5] * g[5]
    s2 = nx * nx + nz * nz
    fore, s = math.sqrt(fore2), math.sqrt(s2)
    at_shoulder = (s2 + g[4] * g[4] - fore2) / (2.0 * s * g[4])
    at_elbow = (s2 - g[4] * g[4] - fore2) / (2.0 * g[4] * fore)
    if not (abs(at_shoulder) < 1.0 + 1e-12 and abs(at_elbow) < 1.0 + 1e-12):
        return False
    bend = math.acos(min(1.0, max(-1.0, at_elbow)))
    lift = math.acos(min(1.0, max(-1.0, at_shoulder)))
    out[1] = math.atan2(nx, nz) - elbow * lift
    out[2] = elbow * bend - math.atan2(g[1], g[5])
    c1, s1 = math.cos(out[0]), math.sin(out[0])
    c23, s23 = math.cos(out[1] + out[2]), math.sin(out[1] + out[2])
    # Rows of (Rz(theta1) Ry(theta2 + theta3))^T times the columns of the hand.
    m13 = c23 * (c1 * hand[2] + s1 * hand[5]) - s23 * hand[8]
    m23 = c1 * hand[5] - s1 * hand[2]
    m33 = s23 * (c1 * hand[2] + s1 * hand[5]) + c23 * hand[8]
    m31 = s23 * (c1 * hand[0] + s1 * hand[3]) + c23 * hand[6]
    m32 = s23 * (c1 * hand[1] + s1 * hand[4]) + c23 * hand[7]
    sine5 = math.sqrt(m13 * m13 + m23 * m23)
    out[4] = math.atan2(flip * sine5, m33)
    if sine5 > 1e-9:
        out[3] = math.atan2(flip * m23, flip * m13)
        out[5] = math.atan2(flip * m32, -flip * m31)
    else:
        m11 = c23 * (c1 * hand[0] + s1 * hand[3]) - s23 * hand[6]
        m21 = c1 * hand[3] - s1 * hand[0]
        total = math.atan2(m21, m11)  # theta 4 + theta 6 with theta 5 = 0
        out[3] = turn4
        out[5] = total - turn4 if m33 > 0.0 else math.atan2(-m21, -m11) + turn4
    return True


@compiled(EXACT, borrows=True)
def _to_joints(p: Closed, theta: Array, near: Array, settle: bool, out: Array) -> float:
    """Writes q (6,) rad at the turn nearest to ``near``; returns its squared distance, rad^2.

    With ``settle`` a joint beyond its limit may take another turn, and a solution that stays
    beyond is ranked behind all others.
    """
    for i in range(6):
        out[i] = p.sign[i] * (theta[i] - p.offset[i])
    if p.coupled:
        mix(p.uncoupling, out)
    distance = 0.0
    for i in range(6):
        q = out[i] + TURN * math.floor((near[i] - out[i]) / TURN + 0.5)
        if settle:
            low, high = p.limits[i, 0], p.limits[i, 1]
            if q > high and q - TURN >= low:
                q -= TURN
            elif q < low and q + TURN <= high:
                q += TURN
            if q > high or q < low:
                distance += OUTSIDE
        out[i] = q
        distance += (q - near[i]) * (q - near[i])
    return distance


@compiled(EXACT, borrows=True)
def closed_joints(
    p: Closed, tool: int, target: Array, near: Array, settle: bool, branch: IntArray,
    theta: Array, trial: Array, hand: Array, out: Array,
) -> bool:  # fmt: skip
    """Writes the nominal joints (6,) rad nearest to ``near``; False where there are none.

    Args:
        p: The arm.
        tool: Index of the tool.
        target: (12,) tool pose in base.
        near: (6,) rad.
        settle: The turns may be chosen anew to stay within the joint limits.
        branch: (3,) shoulder, elbow, flip of the target before, 0 unknown; renewed.
        theta: (6,) work.
        trial: (6,) work.
        hand: (12,) work.
        out: (6,) rad, written.
    """
    place(target, tool, p.end, hand)
    turn4 = p.sign[3] * near[3] + p.offset[3]
    if (
        branch[0] != 0
        and not settle
        and closed_branch(p.lengths, hand, branch[0], branch[1], branch[2], turn4, theta)
    ):
        _to_joints(p, theta, near, False, out)
        widest = 0.0
        for i in range(6):
            widest = max(widest, abs(out[i] - near[i]))
        if widest < NEAR:
            return True
    best = np.inf
    for code in range(8):
        shoulder, elbow, flip = 1 - 2 * (code & 1), 1 - (code & 2), 1 - (code & 4) // 2
        if closed_branch(p.lengths, hand, shoulder, elbow, flip, turn4, theta):
            distance = _to_joints(p, theta, near, settle, trial)
            if distance < best - 1e-12:
                best = distance
                branch[0], branch[1], branch[2] = shoulder, elbow, flip
                for i in range(6):
                    out[i] = trial[i]
    return best < np.inf


@compiled(EXACT, borrows=True)
def mix(matrix: Array, vector: Array) -> None:
    """Replaces a vector (6,) by matrix @ vector."""
    v0, v1, v2, v3, v4, v5 = vector[0], vector[1], vector[2], vector[3], vector[4], vector[5]
    for i in range(6):
        vector[i] = (
            matrix[i, 0] * v0 + matrix[i, 1] * v1 + matrix[i, 2] * v2
            + matrix[i, 3] * v3 + matrix[i, 4] * v4 + matrix[i, 5] * v5
        )  # fmt: skip
