"""The calibrated arm for many targets abreast: chains, load, ripple, smooth residual, Jacobian.

Every quantity is a row of ``LANES`` numbers, one per target, in a flat array: number ``n`` of row
``k`` is ``[k * LANES + n]``. All inner loops run over the lanes without a branch, so that they
become vector instructions, and what happens in one lane cannot change another by a bit. The
formulae are those of :mod:`robotrue.robot.forward`, :mod:`robotrue.robot.statics` and
:mod:`robotrue.calibration.tables`; the tests hold them to a nanometre against each other.
SI, base frame.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.compiled import EXACT, SUMS, compiled
from robotrue.compensation.memory import (
    APPROACH,
    CENTRE,
    JOINTS,
    LANES,
    MASS,
    MOMENT,
    SMOOTH,
    SMOOTH_AT,
    SUM,
    TOOL,
    TORQUE,
    TURNING,
    WRENCH,
    Arm,
    Space,
)
from robotrue.core.arrays import Array
from robotrue.core.sines import ROUND, sines

L = LANES
L6 = 6 * LANES

LOG2E = 1.0 / math.log(2.0)
LN2_HIGH = float.fromhex("0x1.62e42fee00000p-1")
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")


@compiled(EXACT, borrows=True)
def sincos_rows(angle: Array, out: Array) -> None:
    """Writes the sines of six rows, then their cosines, to ``out`` (12 rows); |error| < 2e-16."""
    sines(angle, L6, out)


@compiled(EXACT, borrows=True)
def _walk(c: Array, trig: Array, chain: Array) -> None:
    """Walks C_0 Rz C_1 ... Rz C_6; ``c`` (84,) constants, ``trig`` sines and cosines of theta."""
    for k in range(3):
        x, y, z, p = c[3 * k], c[3 * k + 1], c[3 * k + 2], c[9 + k]
        for n in range(L):
            chain[k * L + n] = x
            chain[(3 + k) * L + n] = y
            chain[(6 + k) * L + n] = z
            chain[(9 + k) * L + n] = p
    for i in range(6):
        m, b = 12 * (i + 1), 12 * i * L
        c0, c1, c2, c3, c4, c5 = c[m], c[m + 1], c[m + 2], c[m + 3], c[m + 4], c[m + 5]
        c6, c7, c8, c9, c10, c11 = c[m + 6], c[m + 7], c[m + 8], c[m + 9], c[m + 10], c[m + 11]
        for k in range(3):  # one row of the rotation and of the origin at a time
            for n in range(L):
                s, e = trig[i * L + n], trig[L6 + i * L + n]
                x, y = chain[b + k * L + n], chain[b + (3 + k) * L + n]
                z, p = chain[b + (6 + k) * L + n], chain[b + (9 + k) * L + n]
                x, y = e * x + s * y, e * y - s * x
                chain[b + (12 + k) * L + n] = x * c0 + y * c3 + z * c6
                chain[b + (15 + k) * L + n] = x * c1 + y * c4 + z * c7
                chain[b + (18 + k) * L + n] = x * c2 + y * c5 + z * c8
                chain[b + (21 + k) * L + n] = p + x * c9 + y * c10 + z * c11


@compiled(EXACT, borrows=True)
def _joint_torque(
    com: Array, mass_out: Array, gravity: Array, lane: Array, trig: Array, told: Array,
    work: Array, torque: Array,
) -> None:  # fmt: skip
    """Writes the torque (6 rows) N m of link weights, payload and wrench about the axes.

    The joints are gone through backwards, by views of their rows: of an index that falls the
    compiler does not see that it stays positive, and then takes one lane at a time.
    """
    g0, g1, g2 = gravity[0], gravity[1], gravity[2]
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        for n in range(L):
            s, e, mass = trig[5 * L + n], trig[11 * L + n], lane[MASS * L + n]
            f0, f1 = lane[CENTRE * L + n], lane[(CENTRE + 1) * L + n]
            work[(MOMENT + k) * L + n] = mass * (
                told[(69 + k) * L + n]
                + (e * f0 - s * f1) * told[(60 + k) * L + n]
                + (s * f0 + e * f1) * told[(63 + k) * L + n]
                + lane[(CENTRE + 2) * L + n] * told[(66 + k) * L + n]
            )
            work[(TURNING + k) * L + n] = (
                told[(TOOL + 9 + u) * L + n] * lane[(WRENCH + v) * L + n]
                - told[(TOOL + 9 + v) * L + n] * lane[(WRENCH + u) * L + n]
                + lane[(WRENCH + 3 + k) * L + n]
            )
    for j in range(6):
        i = 5 - j
        b = 12 * i * L
        a0, a1, a2, a3, outboard = (
            com[4 * i], com[4 * i + 1], com[4 * i + 2], com[4 * i + 3], mass_out[i],
        )  # fmt: skip
        turn, link, out = trig[i * L :], told[b:], torque[i * L :]
        for n in range(L):
            s, e = turn[n], turn[L6 + n]
            x, y = e * a0 - s * a1, s * a0 + e * a1
            z0, z1, z2 = link[6 * L + n], link[7 * L + n], link[8 * L + n]
            o0, o1, o2 = link[9 * L + n], link[10 * L + n], link[11 * L + n]
            m0 = work[MOMENT * L + n] + a3 * o0 + a2 * z0
            m1 = work[(MOMENT + 1) * L + n] + a3 * o1 + a2 * z1
            m2 = work[(MOMENT + 2) * L + n] + a3 * o2 + a2 * z2
            m0 += x * link[n] + y * link[3 * L + n]
            m1 += x * link[L + n] + y * link[4 * L + n]
            m2 += x * link[2 * L + n] + y * link[5 * L + n]
            work[MOMENT * L + n] = m0
            work[(MOMENT + 1) * L + n] = m1
            work[(MOMENT + 2) * L + n] = m2
        for n in range(L):
            z0, z1, z2 = link[6 * L + n], link[7 * L + n], link[8 * L + n]
            o0, o1, o2 = link[9 * L + n], link[10 * L + n], link[11 * L + n]
            m0, m1, m2 = (
                work[MOMENT * L + n], work[(MOMENT + 1) * L + n], work[(MOMENT + 2) * L + n],
            )  # fmt: skip
            mass = outboard + lane[MASS * L + n]
            f0 = mass * g0 + lane[WRENCH * L + n]
            f1 = mass * g1 + lane[(WRENCH + 1) * L + n]
            f2 = mass * g2 + lane[(WRENCH + 2) * L + n]
            t0 = m1 * g2 - m2 * g1 + work[TURNING * L + n] - (o1 * f2 - o2 * f1)
            t1 = m2 * g0 - m0 * g2 + work[(TURNING + 1) * L + n] - (o2 * f0 - o0 * f2)
            t2 = m0 * g1 - m1 * g0 + work[(TURNING + 2) * L + n] - (o0 * f1 - o1 * f0)
            out[n] = z0 * t0 + z1 * t1 + z2 * t2


@compiled(EXACT, borrows=True)
def _mix(matrix: Array, back: bool, rows: Array, at: int, out: Array) -> None:
    """Writes matrix @ six rows from row ``at`` on, or the transposed matrix @ rows."""
    for i in range(6):
        for n in range(L):
            out[i * L + n] = 0.0
        for k in range(6):
            factor = matrix[k, i] if back else matrix[i, k]
            for n in range(L):
                out[i * L + n] += factor * rows[(at + k) * L + n]


@compiled(EXACT, borrows=True)
def _ripple(harmonics: Array, ripple: Array, trig: Array, work: Array, angle: Array) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to the six rows of ``angle``.

    Harmonics 1, 2, ..., h by Clenshaw's recurrence, four steps at a time (missing ones are zero
    rows of ``ripple``). ``trig`` holds sine and cosine of q.
    """
    for i in range(6):
        for n in range(4 * L):
            work[SUM * L + n] = 0.0
        for j in range(harmonics.shape[0] // 4):
            k = harmonics.shape[0] - 4 * j - 1
            a3, a2, a1, a0 = ripple[k, i], ripple[k - 1, i], ripple[k - 2, i], ripple[k - 3, i]
            b3, b2, b1, b0 = (
                ripple[k, i + 6], ripple[k - 1, i + 6], ripple[k - 2, i + 6], ripple[k - 3, i + 6],
            )  # fmt: skip
            for n in range(L):
                e = 2.0 * trig[L6 + i * L + n]
                s, t = work[SUM * L + n], work[(SUM + 1) * L + n]
                t = (a3 - t) + e * s
                s = (a2 - s) + e * t
                t = (a1 - t) + e * s
                work[SUM * L + n] = (a0 - s) + e * t
                work[(SUM + 1) * L + n] = t
                c, d = work[(SUM + 2) * L + n], work[(SUM + 3) * L + n]
                d = (b3 - d) + e * c
                c = (b2 - c) + e * d
                d = (b1 - d) + e * c
                work[(SUM + 2) * L + n] = (b0 - c) + e * d
                work[(SUM + 3) * L + n] = d
        for n in range(L):
            angle[i * L + n] += (
                trig[i * L + n] * work[SUM * L + n]
                + trig[L6 + i * L + n] * work[(SUM + 2) * L + n]
                - work[(SUM + 3) * L + n]
            )


@compiled(EXACT, borrows=True)
def _waves(harmonics: Array, ripple: Array, work: Array, waves: Array, angle: Array) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to the six rows of ``angle``, any N_k.

    ``waves`` (18 rows) is work space.
    """
    turned, trig = waves[:L6], waves[L6:]
    for k in range(harmonics.shape[0]):
        for n in range(L6):
            turned[n] = harmonics[k] * work[JOINTS * L + n]
        sincos_rows(turned, trig)
        for i in range(6):
            a, b = ripple[k, i], ripple[k, i + 6]
            for n in range(L):
                angle[i * L + n] += a * trig[i * L + n] + b * trig[L6 + i * L + n]


@compiled(SUMS, borrows=True)
def _smooth(table: Array, feature: Array, bump: Array, work: Array, n: int) -> None:
    """Writes sum_m w_m exp(-|s - C_m|^2 / 2), the smooth residual (3,) m of lane ``n``.

    Args:
        table: (b, 16 LANES) of as many centres at a time: 12 features, bias, 3 weights.
        feature: (12,) s.
        bump: (2 LANES,) work space.
        work: Rows; three are written.
        n: The lane.
    """
    f = feature
    s0, s1, s2, s3, s4, s5 = f[0], f[1], f[2], f[3], f[4], f[5]
    c0, c1, c2, c3, c4, c5 = f[6], f[7], f[8], f[9], f[10], f[11]
    own = s0 * s0 + s1 * s1 + s2 * s2 + s3 * s3 + s4 * s4 + s5 * s5
    own = -0.5 * (own + c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3 + c4 * c4 + c5 * c5)
    x = y = z = 0.0
    for b in range(table.shape[0]):
        t = table[b]
        for m in range(L):
            u = s0 * t[m] + s1 * t[L + m] + s2 * t[2 * L + m] + s3 * t[3 * L + m]
            u += s4 * t[4 * L + m] + s5 * t[5 * L + m] + c0 * t[6 * L + m] + c1 * t[7 * L + m]
            u += c2 * t[8 * L + m] + c3 * t[9 * L + m] + c4 * t[10 * L + m] + c5 * t[11 * L + m]
            u += t[12 * L + m] + own
            bump[m] = u if u > -700.0 else -700.0
        _exp(bump)
        for m in range(L):
            x += t[13 * L + m] * bump[m]
            y += t[14 * L + m] * bump[m]
            z += t[15 * L + m] * bump[m]
    work[SMOOTH * L + n] = x
    work[(SMOOTH + 1) * L + n] = y
    work[(SMOOTH + 2) * L + n] = z


@compiled(EXACT, borrows=True)
def _exp(bump: Array) -> None:
    """Replaces LANES values between -700 and 0 by their exponentials; |error| < 1e-14."""
    for m in range(L):
        x = bump[m]
        shifted = x * LOG2E + ROUND
        power = shifted - ROUND
        r = x - power * LN2_HIGH - power * LN2_LOW
        e = r * (1.0 / 39916800.0) + 1.0 / 3628800.0
        e = e * r + 1.0 / 362880.0
        e = e * r + 1.0 / 40320.0
        e = e * r + 1.0 / 5040.0
        e = e * r + 1.0 / 720.0
        e = e * r + 1.0 / 120.0
        e = e * r + 1.0 / 24.0
        e = e * r + 1.0 / 6.0
        e = e * r + 0.5
        e = e * r + 1.0
        bump[m] = e * r + 1.0
        bump[L + m] = shifted
    bits = bump.view(np.int64)
    for m in range(L):
        bits[m] += bits[L + m] << 52  # times 2**power: the low bits of shifted hold it


@compiled(EXACT, borrows=True)
def evaluate(a: Arm, s: Space, reuse: float) -> None:
    """Writes both chains at the joints of all lanes, smooth residual included.

    The smooth residual is computed anew where a joint moved by more than ``reuse`` since.
    """
    work, angle = s.work, s.angle
    if a.coupled:
        _mix(a.coupling, False, work, JOINTS, angle)
    else:
        for n in range(L6):
            angle[n] = work[JOINTS * L + n]
    for i in range(6):
        for n in range(L):
            angle[i * L + n] += a.zero[i]
    sincos_rows(angle, s.trig)
    _walk(a.nominal, s.trig, s.told)
    torque = s.waves[:L6]
    _joint_torque(a.com, a.mass_out, a.gravity, s.lane, s.trig, s.told, work, torque)
    if a.coupled:
        _mix(a.coupling, True, torque, 0, s.spare)
        torque = s.spare
    for i in range(6):
        c, g, b = a.compliance[i], a.gear[i], a.backlash[i]
        for n in range(L):
            work[(TORQUE + i) * L + n] = (
                c * torque[i * L + n]
                + g * work[(JOINTS + i) * L + n]
                + b * s.lane[(APPROACH + i) * L + n]
            )
    ripples, bumps = a.harmonics.shape[0] > 0, a.table.shape[0] > 0
    if ripples or bumps:
        for n in range(L6):
            s.spare[n] = work[JOINTS * L + n]
        sincos_rows(s.spare, s.own)
    if ripples:
        for n in range(L6):
            s.spare[n] = work[TORQUE * L + n]
        if a.consecutive:
            _ripple(a.harmonics, a.ripple, s.own, work, s.spare)
        else:
            _waves(a.harmonics, a.ripple, work, s.waves, s.spare)
        for n in range(L6):
            work[TORQUE * L + n] = s.spare[n]
    if a.coupled:
        _mix(a.coupling, False, work, TORQUE, s.spare)
        for n in range(L6):
            angle[n] += s.spare[n]
    else:
        for n in range(L6):
            angle[n] += work[TORQUE * L + n]
    for i in range(6):
        for n in range(L):
            angle[i * L + n] += a.dtheta[i]
    sincos_rows(angle, s.bent)
    _walk(a.actual, s.bent, s.real)
    if bumps:
        for n in range(L):
            moved = 0.0
            for i in range(6):
                change = work[(JOINTS + i) * L + n] - work[(SMOOTH_AT + i) * L + n]
                moved = max(moved, abs(change))
            if not moved <= reuse:
                for i in range(6):
                    s.feature[i] = s.own[i * L + n] * a.scale[i]
                    s.feature[6 + i] = s.own[L6 + i * L + n] * a.scale[6 + i]
                    work[(SMOOTH_AT + i) * L + n] = work[(JOINTS + i) * L + n]
                _smooth(a.table, s.feature, s.bump, work, n)
        for n in range(3 * L):
            s.real[(TOOL + 9) * L + n] += work[SMOOTH * L + n]


@compiled(EXACT, borrows=True)
def jacobian(a: Arm, real: Array, matrix: Array, spare: Array) -> None:
    """Writes dx/dq (6, 6) of the actual tool, linear rows divided by ``length``."""
    scale = 1.0 / a.length
    for i in range(6):
        gain = 1.0 if a.coupled else 1.0 + a.gear[i]
        b = 12 * i * L
        for n in range(L):
            a0 = real[b + 6 * L + n] * gain
            a1 = real[b + 7 * L + n] * gain
            a2 = real[b + 8 * L + n] * gain
            r0 = (real[(TOOL + 9) * L + n] - real[b + 9 * L + n]) * scale
            r1 = (real[(TOOL + 10) * L + n] - real[b + 10 * L + n]) * scale
            r2 = (real[(TOOL + 11) * L + n] - real[b + 11 * L + n]) * scale
            matrix[i * L + n] = a1 * r2 - a2 * r1
            matrix[(6 + i) * L + n] = a2 * r0 - a0 * r2
            matrix[(12 + i) * L + n] = a0 * r1 - a1 * r0
            matrix[(18 + i) * L + n] = a0
            matrix[(24 + i) * L + n] = a1
            matrix[(30 + i) * L + n] = a2
    if a.coupled:
        for k in range(6):
            _mix(a.coupling, True, matrix, 6 * k, spare)
            for i in range(6):
                gain = 1.0 + a.gear[i]
                for n in range(L):
                    matrix[(6 * k + i) * L + n] = spare[i * L + n] * gain
