"""Inversion of the calibrated arm for many targets abreast.

Every quantity is a row of ``LANES`` numbers, one per target, in a flat array: number ``l`` of row
``k`` is ``[k * LANES + l]``. All inner loops run over the lanes without a branch, so that they
become vector instructions, and what happens in one lane cannot change another by a bit. The
formulae are those of :mod:`robotrue.robot.forward`, :mod:`robotrue.robot.statics` and
:mod:`robotrue.calibration.tables`; the tests hold them to a nanometre against each other.

Chord Newton: the normal equations of the Jacobian at the nominal joints serve for all steps.
Lanes that are nearly singular or do not arrive are left to
:mod:`robotrue.compensation.stragglers`. SI, base frame.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.compiled import EXACT, SUMS, compiled
from robotrue.compensation.memory import (
    APPROACH,
    CENTRE,
    ERROR,
    JOINTS,
    LANES,
    MASS,
    MOMENT,
    NORMAL,
    PIVOT,
    PULL,
    SHIFT,
    SMOOTH,
    SMOOTH_AT,
    START,
    STEP,
    SUM,
    TARGET,
    TOLD_SHIFT,
    TOLD_TURN,
    TOOL,
    TORQUE,
    TRACE,
    TURN,
    TURNING,
    WRENCH,
    Aim,
    Arm,
    Asked,
    Space,
)
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray

L = LANES
L6 = 6 * LANES
ROUNDS = 4  # steps before a lane is a straggler; two are the rule

AXES = int(Route.AXES)
DONE, LOST = int(Status.COMPENSATED), int(Status.UNCHANGED_NOT_CONVERGED)
UNREACHABLE = int(Status.UNCHANGED_UNREACHABLE)
SINGULAR, WRIST = int(Status.UNCHANGED_SINGULAR), int(Status.UNCHANGED_WRIST_SINGULAR)
STRAGGLER = -1  # not a status: to be solved one by one
WEAK = 1e-3  # smallest singular value at which the normal equations keep ten digits

TWO_OVER_PI = 2.0 / math.pi
HALF_PI_HIGH = float.fromhex("0x1.921fb54400000p+0")  # 33 bits: exact times any small integer
HALF_PI_LOW = float.fromhex("0x1.0b4611a626331p-34")
LOG2E = 1.0 / math.log(2.0)
LN2_HIGH = float.fromhex("0x1.62e42fee00000p-1")
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")
ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the low bits


@compiled(EXACT)
def sincos_rows(angle: Array, out: Array) -> None:
    """Writes the sines of six rows, then their cosines, to ``out`` (12 rows); |error| < 2e-16.

    Angles up to 1e5 rad: quarter turns are taken off in two parts, Taylor series do the rest.
    """
    for l in range(L6):
        x = angle[l]
        k = (x * TWO_OVER_PI + ROUND) - ROUND
        r = (x - k * HALF_PI_HIGH) - k * HALF_PI_LOW
        z = r * r
        s = z * (-1.0 / 1307674368000.0) + 1.0 / 6227020800.0
        s = s * z - 1.0 / 39916800.0
        s = s * z + 1.0 / 362880.0
        s = s * z - 1.0 / 5040.0
        s = s * z + 1.0 / 120.0
        s = s * z - 1.0 / 6.0
        s = s * (z * r) + r
        c = z * (1.0 / 20922789888000.0) - 1.0 / 87178291200.0
        c = c * z + 1.0 / 479001600.0
        c = c * z - 1.0 / 3628800.0
        c = c * z + 1.0 / 40320.0
        c = c * z - 1.0 / 720.0
        c = c * z + 1.0 / 24.0
        c = c * z - 0.5
        c = c * z + 1.0
        quarter = k - 4.0 * ((k * 0.25 + ROUND) - ROUND)  # -2, -1, 0, 1 or 2
        odd = abs(quarter) == 1.0
        sine = c if odd else s
        cosine = s if odd else c
        out[l] = -sine if (quarter < -0.5 or quarter > 1.5) else sine
        out[L6 + l] = -cosine if (quarter > 0.5 or quarter < -1.5) else cosine


@compiled(EXACT)
def _walk(c: Array, trig: Array, chain: Array) -> None:
    """Walks C_0 Rz C_1 ... Rz C_6; ``c`` (84,) constants, ``trig`` sines and cosines of theta."""
    for k in range(3):
        x, y, z, p = c[3 * k], c[3 * k + 1], c[3 * k + 2], c[9 + k]
        for l in range(L):
            chain[k * L + l] = x
            chain[(3 + k) * L + l] = y
            chain[(6 + k) * L + l] = z
            chain[(9 + k) * L + l] = p
    for i in range(6):
        n, b = 12 * (i + 1), 12 * i * L
        c0, c1, c2, c3, c4, c5 = c[n], c[n + 1], c[n + 2], c[n + 3], c[n + 4], c[n + 5]
        c6, c7, c8, c9, c10, c11 = c[n + 6], c[n + 7], c[n + 8], c[n + 9], c[n + 10], c[n + 11]
        for k in range(3):  # one row of the rotation and of the origin at a time
            for l in range(L):
                s, e = trig[i * L + l], trig[L6 + i * L + l]
                x, y = chain[b + k * L + l], chain[b + (3 + k) * L + l]
                z, p = chain[b + (6 + k) * L + l], chain[b + (9 + k) * L + l]
                x, y = e * x + s * y, e * y - s * x
                chain[b + (12 + k) * L + l] = x * c0 + y * c3 + z * c6
                chain[b + (15 + k) * L + l] = x * c1 + y * c4 + z * c7
                chain[b + (18 + k) * L + l] = x * c2 + y * c5 + z * c8
                chain[b + (21 + k) * L + l] = p + x * c9 + y * c10 + z * c11


@compiled(EXACT)
def _joint_torque(
    com: Array, mass_out: Array, gravity: Array, lane: Array, trig: Array, told: Array, work: Array
) -> None:
    """Writes the torque (6 rows) N m of link weights, payload and wrench about the axes."""
    g0, g1, g2 = gravity[0], gravity[1], gravity[2]
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        for l in range(L):
            s, e, mass = trig[5 * L + l], trig[11 * L + l], lane[MASS * L + l]
            f0, f1 = lane[CENTRE * L + l], lane[(CENTRE + 1) * L + l]
            work[(MOMENT + k) * L + l] = mass * (
                told[(69 + k) * L + l]
                + (e * f0 - s * f1) * told[(60 + k) * L + l]
                + (s * f0 + e * f1) * told[(63 + k) * L + l]
                + lane[(CENTRE + 2) * L + l] * told[(66 + k) * L + l]
            )
            work[(TURNING + k) * L + l] = (
                told[(TOOL + 9 + u) * L + l] * lane[(WRENCH + v) * L + l]
                - told[(TOOL + 9 + v) * L + l] * lane[(WRENCH + u) * L + l]
                + lane[(WRENCH + 3 + k) * L + l]
            )
    for j in range(6):
        i = 5 - j
        b = 12 * i * L
        a0, a1, a2, a3, outboard = (
            com[4 * i], com[4 * i + 1], com[4 * i + 2], com[4 * i + 3], mass_out[i],
        )  # fmt: skip
        for l in range(L):
            s, e = trig[i * L + l], trig[L6 + i * L + l]
            x, y = e * a0 - s * a1, s * a0 + e * a1
            z0, z1, z2 = told[b + 6 * L + l], told[b + 7 * L + l], told[b + 8 * L + l]
            o0, o1, o2 = told[b + 9 * L + l], told[b + 10 * L + l], told[b + 11 * L + l]
            m0 = work[MOMENT * L + l] + a3 * o0 + a2 * z0
            m1 = work[(MOMENT + 1) * L + l] + a3 * o1 + a2 * z1
            m2 = work[(MOMENT + 2) * L + l] + a3 * o2 + a2 * z2
            m0 += x * told[b + l] + y * told[b + 3 * L + l]
            m1 += x * told[b + L + l] + y * told[b + 4 * L + l]
            m2 += x * told[b + 2 * L + l] + y * told[b + 5 * L + l]
            work[MOMENT * L + l] = m0
            work[(MOMENT + 1) * L + l] = m1
            work[(MOMENT + 2) * L + l] = m2
            mass = outboard + lane[MASS * L + l]
            f0 = mass * g0 + lane[WRENCH * L + l]
            f1 = mass * g1 + lane[(WRENCH + 1) * L + l]
            f2 = mass * g2 + lane[(WRENCH + 2) * L + l]
            t0 = m1 * g2 - m2 * g1 + work[TURNING * L + l] - (o1 * f2 - o2 * f1)
            t1 = m2 * g0 - m0 * g2 + work[(TURNING + 1) * L + l] - (o2 * f0 - o0 * f2)
            t2 = m0 * g1 - m1 * g0 + work[(TURNING + 2) * L + l] - (o0 * f1 - o1 * f0)
            work[(TORQUE + i) * L + l] = z0 * t0 + z1 * t1 + z2 * t2


@compiled(EXACT)
def _mix(matrix: Array, back: bool, rows: Array, at: int, out: Array) -> None:
    """Writes matrix @ six rows from row ``at`` on, or the transposed matrix @ rows."""
    for i in range(6):
        for l in range(L):
            out[i * L + l] = 0.0
        for k in range(6):
            factor = matrix[k, i] if back else matrix[i, k]
            for l in range(L):
                out[i * L + l] += factor * rows[(at + k) * L + l]


@compiled(EXACT)
def _ripple(harmonics: Array, ripple: Array, trig: Array, work: Array, angle: Array) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to the six rows of ``angle``.

    Harmonics 1, 2, ..., h by Clenshaw's recurrence, four steps at a time (missing ones are zero
    rows of ``ripple``). ``trig`` holds sine and cosine of q.
    """
    for i in range(6):
        for l in range(4 * L):
            work[SUM * L + l] = 0.0
        for j in range(harmonics.shape[0] // 4):
            k = harmonics.shape[0] - 4 * j - 1
            a3, a2, a1, a0 = ripple[k, i], ripple[k - 1, i], ripple[k - 2, i], ripple[k - 3, i]
            b3, b2, b1, b0 = (
                ripple[k, i + 6], ripple[k - 1, i + 6], ripple[k - 2, i + 6], ripple[k - 3, i + 6],
            )  # fmt: skip
            for l in range(L):
                e = 2.0 * trig[L6 + i * L + l]
                s, t = work[SUM * L + l], work[(SUM + 1) * L + l]
                t = (a3 - t) + e * s
                s = (a2 - s) + e * t
                t = (a1 - t) + e * s
                work[SUM * L + l] = (a0 - s) + e * t
                work[(SUM + 1) * L + l] = t
                c, d = work[(SUM + 2) * L + l], work[(SUM + 3) * L + l]
                d = (b3 - d) + e * c
                c = (b2 - c) + e * d
                d = (b1 - d) + e * c
                work[(SUM + 2) * L + l] = (b0 - c) + e * d
                work[(SUM + 3) * L + l] = d
        for l in range(L):
            angle[i * L + l] += (
                trig[i * L + l] * work[SUM * L + l]
                + trig[L6 + i * L + l] * work[(SUM + 2) * L + l]
                - work[(SUM + 3) * L + l]
            )


@compiled(EXACT)
def _waves(harmonics: Array, ripple: Array, work: Array, waves: Array, angle: Array) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to the six rows of ``angle``, any N_k.

    ``waves`` (18 rows) is work space.
    """
    turned, trig = waves[:L6], waves[L6:]
    for k in range(harmonics.shape[0]):
        for l in range(L6):
            turned[l] = harmonics[k] * work[JOINTS * L + l]
        sincos_rows(turned, trig)
        for i in range(6):
            a, b = ripple[k, i], ripple[k, i + 6]
            for l in range(L):
                angle[i * L + l] += a * trig[i * L + l] + b * trig[L6 + i * L + l]


@compiled(SUMS)
def _smooth(table: Array, feature: Array, bump: Array, work: Array, l: int) -> None:
    """Writes sum_m w_m exp(-|s - C_m|^2 / 2), the smooth residual (3,) m of lane ``l``.

    Args:
        table: (b, 16 LANES) of as many centres at a time: 12 features, bias, 3 weights.
        feature: (12,) s.
        bump: (2 LANES,) work space.
        work: Rows; three are written.
        l: The lane.
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
    work[SMOOTH * L + l] = x
    work[(SMOOTH + 1) * L + l] = y
    work[(SMOOTH + 2) * L + l] = z


@compiled(EXACT)
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


@compiled(EXACT)
def _evaluate(a: Arm, s: Space, reuse: float) -> None:
    """Writes both chains at the joints of all lanes, smooth residual included.

    The smooth residual is computed anew where a joint moved by more than ``reuse`` since.
    """
    work, angle = s.work, s.angle
    if a.coupled:
        _mix(a.coupling, False, work, JOINTS, angle)
    else:
        for l in range(L6):
            angle[l] = work[JOINTS * L + l]
    for i in range(6):
        for l in range(L):
            angle[i * L + l] += a.zero[i]
    sincos_rows(angle, s.trig)
    _walk(a.nominal, s.trig, s.told)
    _joint_torque(a.com, a.mass_out, a.gravity, s.lane, s.trig, s.told, work)
    if a.coupled:
        _mix(a.coupling, True, work, TORQUE, s.spare)
        for l in range(L6):
            work[TORQUE * L + l] = s.spare[l]
    for i in range(6):
        c, g, b = a.compliance[i], a.gear[i], a.backlash[i]
        for l in range(L):
            work[(TORQUE + i) * L + l] = (
                c * work[(TORQUE + i) * L + l]
                + g * work[(JOINTS + i) * L + l]
                + b * s.lane[(APPROACH + i) * L + l]
            )
    ripples, bumps = a.harmonics.shape[0] > 0, a.table.shape[0] > 0
    if ripples or bumps:
        for l in range(L6):
            s.spare[l] = work[JOINTS * L + l]
        sincos_rows(s.spare, s.own)
    if ripples:
        for l in range(L6):
            s.spare[l] = work[TORQUE * L + l]
        if a.consecutive:
            _ripple(a.harmonics, a.ripple, s.own, work, s.spare)
        else:
            _waves(a.harmonics, a.ripple, work, s.waves, s.spare)
        for l in range(L6):
            work[TORQUE * L + l] = s.spare[l]
    if a.coupled:
        _mix(a.coupling, False, work, TORQUE, s.spare)
        for l in range(L6):
            angle[l] += s.spare[l]
    else:
        for l in range(L6):
            angle[l] += work[TORQUE * L + l]
    for i in range(6):
        for l in range(L):
            angle[i * L + l] += a.dtheta[i]
    sincos_rows(angle, s.bent)
    _walk(a.actual, s.bent, s.real)
    if bumps:
        for l in range(L):
            moved = 0.0
            for i in range(6):
                change = work[(JOINTS + i) * L + l] - work[(SMOOTH_AT + i) * L + l]
                moved = max(moved, abs(change))
            if not moved <= reuse:
                for i in range(6):
                    s.feature[i] = s.own[i * L + l] * a.scale[i]
                    s.feature[6 + i] = s.own[L6 + i * L + l] * a.scale[6 + i]
                    work[(SMOOTH_AT + i) * L + l] = work[(JOINTS + i) * L + l]
                _smooth(a.table, s.feature, s.bump, work, l)
        for l in range(3 * L):
            s.real[(TOOL + 9) * L + l] += work[SMOOTH * L + l]


@compiled(EXACT)
def _deviation(chain: Array, lane: Array, work: Array, size: int) -> None:
    """Writes tool minus target: (6 rows) m, sine of the rotation vector; and both lengths.

    Lanes more than a quarter turn away get an infinite turn.
    """
    for l in range(L):
        d0 = chain[(TOOL + 9) * L + l] - lane[(TARGET + 9) * L + l]
        d1 = chain[(TOOL + 10) * L + l] - lane[(TARGET + 10) * L + l]
        d2 = chain[(TOOL + 11) * L + l] - lane[(TARGET + 11) * L + l]
        a0, a1, a2 = chain[TOOL * L + l], chain[(TOOL + 1) * L + l], chain[(TOOL + 2) * L + l]
        b0, b1, b2 = lane[TARGET * L + l], lane[(TARGET + 1) * L + l], lane[(TARGET + 2) * L + l]
        x, y, z = b1 * a2 - b2 * a1, b2 * a0 - b0 * a2, b0 * a1 - b1 * a0
        trace = a0 * b0 + a1 * b1 + a2 * b2
        a0, a1, a2 = (
            chain[(TOOL + 3) * L + l], chain[(TOOL + 4) * L + l], chain[(TOOL + 5) * L + l],
        )  # fmt: skip
        b0, b1, b2 = (
            lane[(TARGET + 3) * L + l], lane[(TARGET + 4) * L + l], lane[(TARGET + 5) * L + l],
        )  # fmt: skip
        x += b1 * a2 - b2 * a1
        y += b2 * a0 - b0 * a2
        z += b0 * a1 - b1 * a0
        trace += a0 * b0 + a1 * b1 + a2 * b2
        a0, a1, a2 = (
            chain[(TOOL + 6) * L + l], chain[(TOOL + 7) * L + l], chain[(TOOL + 8) * L + l],
        )  # fmt: skip
        b0, b1, b2 = (
            lane[(TARGET + 6) * L + l], lane[(TARGET + 7) * L + l], lane[(TARGET + 8) * L + l],
        )  # fmt: skip
        x += b1 * a2 - b2 * a1
        y += b2 * a0 - b0 * a2
        z += b0 * a1 - b1 * a0
        trace += a0 * b0 + a1 * b1 + a2 * b2
        work[ERROR * L + l], work[(ERROR + 1) * L + l], work[(ERROR + 2) * L + l] = d0, d1, d2
        work[(ERROR + 3) * L + l] = 0.5 * x
        work[(ERROR + 4) * L + l] = 0.5 * y
        work[(ERROR + 5) * L + l] = 0.5 * z
        turn = 0.5 * math.sqrt(x * x + y * y + z * z)
        work[size * L + l] = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        work[(size + 1) * L + l] = turn if trace >= 1.0 else np.inf


@compiled(EXACT)
def _jacobian(a: Arm, real: Array, matrix: Array, spare: Array) -> None:
    """Writes dx/dq (6, 6) of the actual tool, linear rows divided by ``length``."""
    scale = 1.0 / a.length
    for i in range(6):
        gain = 1.0 if a.coupled else 1.0 + a.gear[i]
        b = 12 * i * L
        for l in range(L):
            a0 = real[b + 6 * L + l] * gain
            a1 = real[b + 7 * L + l] * gain
            a2 = real[b + 8 * L + l] * gain
            r0 = (real[(TOOL + 9) * L + l] - real[b + 9 * L + l]) * scale
            r1 = (real[(TOOL + 10) * L + l] - real[b + 10 * L + l]) * scale
            r2 = (real[(TOOL + 11) * L + l] - real[b + 11 * L + l]) * scale
            matrix[i * L + l] = a1 * r2 - a2 * r1
            matrix[(6 + i) * L + l] = a2 * r0 - a0 * r2
            matrix[(12 + i) * L + l] = a0 * r1 - a1 * r0
            matrix[(18 + i) * L + l] = a0
            matrix[(24 + i) * L + l] = a1
            matrix[(30 + i) * L + l] = a2
    if a.coupled:
        for k in range(6):
            _mix(a.coupling, True, matrix, 6 * k, spare)
            for i in range(6):
                gain = 1.0 + a.gear[i]
                for l in range(L):
                    matrix[(6 * k + i) * L + l] = spare[i * L + l] * gain


@compiled(EXACT)
def _normal_inverse(matrix: Array) -> None:
    """Writes the inverse of J^T J by symmetric sweeps, its trace and its least pivot.

    The trace is the squared norm of the inverse of J: no pivot needs choosing in a positive
    definite matrix, so all lanes do the same.
    """
    for i in range(6):
        for j in range(i + 1):
            for l in range(L):
                total = matrix[i * L + l] * matrix[j * L + l]
                for k in range(1, 6):
                    total += matrix[(6 * k + i) * L + l] * matrix[(6 * k + j) * L + l]
                matrix[(NORMAL + 6 * i + j) * L + l] = total
                matrix[(NORMAL + 6 * j + i) * L + l] = total
    for l in range(L):
        matrix[PIVOT * L + l] = np.inf
        matrix[TRACE * L + l] = 0.0
    for k in range(6):
        row = NORMAL + 6 * k
        for l in range(L):
            pivot = matrix[(row + k) * L + l]
            least = matrix[PIVOT * L + l]
            matrix[PIVOT * L + l] = pivot if not pivot >= least else least
            matrix[(row + k) * L + l] = 1.0
            scale = 1.0 / pivot
            for j in range(6):
                matrix[(row + j) * L + l] *= scale
        for i in range(6):
            if i != k:
                at = NORMAL + 6 * i
                for l in range(L):
                    f = matrix[(at + k) * L + l]
                    matrix[(at + k) * L + l] = 0.0
                    for j in range(6):
                        matrix[(at + j) * L + l] -= f * matrix[(row + j) * L + l]
    for i in range(6):
        for l in range(L):
            matrix[TRACE * L + l] += matrix[(NORMAL + 7 * i) * L + l]


@compiled(EXACT)
def _step(a: Arm, matrix: Array, work: Array) -> None:
    """Writes the chord step (6 rows) rad: (J^T J)^-1 J^T error."""
    scale = 1.0 / a.length
    for i in range(6):
        for l in range(L):
            linear = matrix[i * L + l] * work[ERROR * L + l]
            linear += matrix[(6 + i) * L + l] * work[(ERROR + 1) * L + l]
            linear += matrix[(12 + i) * L + l] * work[(ERROR + 2) * L + l]
            total = linear * scale + matrix[(18 + i) * L + l] * work[(ERROR + 3) * L + l]
            total += matrix[(24 + i) * L + l] * work[(ERROR + 4) * L + l]
            work[(PULL + i) * L + l] = total + matrix[(30 + i) * L + l] * work[(ERROR + 5) * L + l]
    for i in range(6):
        for l in range(L):
            total = matrix[(NORMAL + 6 * i) * L + l] * work[PULL * L + l]
            for k in range(1, 6):
                total += matrix[(NORMAL + 6 * i + k) * L + l] * work[(PULL + k) * L + l]
            work[(STEP + i) * L + l] = total


@compiled(EXACT)
def _gather(a: Arm, r: Asked, rows: IntArray, first: int, lane: Array, work: Array) -> int:
    """Fills the lanes with rows[first:]; lanes left over repeat the last. Returns how many."""
    count = min(L, len(rows) - first)
    for l in range(L):
        i = rows[first + min(l, count - 1)]
        for j in range(3):  # columns of the rotation one after the other, then the position
            for k in range(3):
                lane[(TARGET + 3 * j + k) * L + l] = r.target[i, 3 * k + j]
            lane[(TARGET + 9 + j) * L + l] = r.target[i, 9 + j]
        for k in range(6):
            lane[(START + k) * L + l] = r.nominal[i, k]
            lane[(APPROACH + k) * L + l] = r.approach[i, k]
            lane[(WRENCH + k) * L + l] = r.wrench[i if r.wrench.shape[0] > 1 else 0, k]
        lane[MASS * L + l] = r.mass[i if r.mass.shape[0] > 1 else 0]
        c = i if r.com.shape[0] > 1 else 0
        for k in range(3):
            total = a.flange[9 + k]
            for j in range(3):
                total += a.flange[3 * k + j] * r.com[c, j]
            lane[(CENTRE + k) * L + l] = total
        for k in range(6):
            work[(JOINTS + k) * L + l] = lane[(START + k) * L + l]
            work[(SMOOTH_AT + k) * L + l] = np.inf
    return count


@compiled(EXACT)
def correct(a: Arm, g: Aim, r: Asked, rows: IntArray, s: Space) -> None:
    """Inverts the arm for the rows given, all with one tool; writes into ``r``."""
    work, lane = s.work, s.lane
    for first in range(0, len(rows), L):
        count = _gather(a, r, rows, first, lane, work)
        _evaluate(a, s, g.reuse)
        _take_axes(r, rows, first, count, s.told, lane)
        _deviation(s.told, lane, work, TOLD_SHIFT)
        _deviation(s.real, lane, work, SHIFT)
        _jacobian(a, s.real, s.matrix, s.spare)
        _normal_inverse(s.matrix)
        left = _begin(g, r, rows, first, count, s)
        for _ in range(ROUNDS):
            if left == 0:
                break
            _step(a, s.matrix, work)
            for i in range(6):
                for l in range(L):
                    old = work[(JOINTS + i) * L + l]
                    new = old - work[(STEP + i) * L + l]
                    work[(JOINTS + i) * L + l] = new if s.open[l] == 1.0 else old
            _evaluate(a, s, g.reuse)
            _deviation(s.real, lane, work, SHIFT)
            left = _review(g, r, rows, first, count, s)
        for l in range(count):
            _scatter(r, rows[first + l], s, l)


@compiled(EXACT)
def _take_axes(r: Asked, rows: IntArray, first: int, count: int, told: Array, lane: Array) -> None:
    """Makes the nominal pose the target where axes were given."""
    for l in range(count):
        i = rows[first + l]
        if r.route[i] == AXES:
            for k in range(12):
                lane[(TARGET + k) * L + l] = told[(TOOL + k) * L + l]
            for j in range(3):
                for k in range(3):
                    r.target[i, 3 * k + j] = told[(TOOL + 3 * j + k) * L + l]
                r.target[i, 9 + j] = told[(TOOL + 9 + j) * L + l]


@compiled(EXACT)
def _wrist_sine(told: Array, l: int) -> float:
    """Returns the sine between axes 4 and 6 of the nominal arm."""
    a, b = (36 + 6) * L + l, (60 + 6) * L + l
    x = told[a + L] * told[b + 2 * L] - told[a + 2 * L] * told[b + L]
    y = told[a + 2 * L] * told[b] - told[a] * told[b + 2 * L]
    z = told[a] * told[b + L] - told[a + L] * told[b]
    return math.sqrt(x * x + y * y + z * z)


@compiled(EXACT)
def _begin(g: Aim, r: Asked, rows: IntArray, first: int, count: int, s: Space) -> int:
    """Writes error and posture at the nominal joints; returns how many lanes need a step."""
    work, told, left = s.work, s.told, 0
    for l in range(L):
        s.open[l] = 0.0
    for l in range(count):
        i = rows[first + l]
        if not (work[TOLD_SHIFT * L + l] < 1e-7 and work[TOLD_TURN * L + l] < 1e-7):
            r.code[i] = UNREACHABLE
            continue
        for k in range(3):
            r.before[i, k] = r.after[i, k] = work[(ERROR + k) * L + l]
        singular = 1.0 / math.sqrt(s.matrix[TRACE * L + l])
        weak = not (s.matrix[PIVOT * L + l] > WEAK * WEAK and singular > WEAK)
        if weak or not work[(SHIFT + 1) * L + l] < 1.0:
            r.code[i] = STRAGGLER
            continue
        r.singular[i] = singular
        if _wrist_sine(told, l) < g.min_wrist_sine:
            r.code[i] = WRIST
        elif singular < g.min_singular_value:
            r.code[i] = SINGULAR
        elif work[SHIFT * L + l] < g.tolerance and work[TURN * L + l] < g.turn_tolerance:
            r.code[i] = DONE
        else:
            r.code[i] = STRAGGLER
            s.open[l] = 1.0
            left += 1
    return left


@compiled(EXACT)
def _review(g: Aim, r: Asked, rows: IntArray, first: int, count: int, s: Space) -> int:
    """Closes the lanes that have arrived; returns how many have not."""
    left = 0
    for l in range(count):
        if s.open[l] == 0.0:
            continue
        i = rows[first + l]
        for k in range(3):
            r.after[i, k] = s.work[(ERROR + k) * L + l]
        if s.work[SHIFT * L + l] < g.tolerance and s.work[TURN * L + l] < g.turn_tolerance:
            r.code[i] = DONE
            s.open[l] = 0.0
        else:
            left += 1
    return left


@compiled(EXACT)
def _scatter(r: Asked, i: int, s: Space, l: int) -> None:
    """Writes joints and command of one lane."""
    for k in range(6):
        r.found[i, k] = s.work[(JOINTS + k) * L + l]
    for j in range(3):
        for k in range(3):
            r.told[i, 3 * k + j] = s.told[(TOOL + 3 * j + k) * L + l]
        r.told[i, 9 + j] = s.told[(TOOL + 9 + j) * L + l]


@compiled(EXACT)
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
        for l in range(L):
            for k in range(6):
                s.work[(JOINTS + k) * L + l] = joints[first + min(l, count - 1), k]
        _evaluate(a, s, 0.0)
        _jacobian(a, s.real, s.matrix, s.spare)
        for l in range(count):
            i = first + l
            _scatter(r, rows[i], s, l)
            for j in range(3):
                for k in range(3):
                    real[i, 3 * k + j] = s.real[(TOOL + 3 * j + k) * L + l]
                real[i, 9 + j] = s.real[(TOOL + 9 + j) * L + l]
            for k in range(36):
                matrix[i, k // 6, k % 6] = s.matrix[k * L + l]
            wrist[i] = _wrist_sine(s.told, l)
