"""Scalar kernels: the calibrated arm and its inversion, about a microsecond per target.

The formulae are those of :mod:`robotrue.robot.forward`, :mod:`robotrue.robot.statics` and
:mod:`robotrue.calibration.tables`; the tests hold them to a nanometre against each other.
All arguments are SI, base frame; a pose is twelve numbers, rotation row by row, then position.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.compiled import EXACT, SUMS, compiled
from robotrue.compensation.pack import Pack
from robotrue.core.arrays import Array

LOG2E = 1.0 / math.log(2.0)
LN2_HIGH = float.fromhex("0x1.62e42fee00000p-1")
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")
SIN3, SIN5, SIN7 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0
COS4, COS6, COS8 = 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0
ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the low bits


@compiled(EXACT)
def turn_sincos(
    sine: Array, cosine: Array, angle: Array, out_sine: Array, out_cosine: Array
) -> None:
    """Writes sin and cos of (x + angle) from those of x; small angles by series."""
    for i in range(6):
        a = angle[i]
        a2 = a * a
        if a2 < 4e-4:
            s = a + a * a2 * (SIN3 + a2 * (SIN5 + a2 * SIN7))
            c = 1.0 + a2 * (-0.5 + a2 * (COS4 + a2 * (COS6 + a2 * COS8)))
        else:
            s = math.sin(a)
            c = math.cos(a)
        out_sine[i] = sine[i] * c + cosine[i] * s
        out_cosine[i] = cosine[i] * c - sine[i] * s


@compiled(EXACT)
def chain(
    c: Array, sine: Array, cosine: Array, weigh: bool, com: Array, flange: Array,
    axis: Array, origin: Array, moment: Array, last: Array, out: Array,
) -> None:  # fmt: skip
    """Walks C_0 Rz C_1 ... Rz C_6: pose of the tool, joint axes, and first moments of the links.

    Args:
        c: (7, 12) C_0..C_6.
        sine: (6,) of theta.
        cosine: (6,) of theta.
        weigh: Whether moments and ``last`` are wanted.
        com: (6, 4) first moment and mass per link.
        flange: (3,) m, point behind joint 6 to place.
        axis: (6, 3), written.
        origin: (6, 3) m, written.
        moment: (6, 3) kg m, written.
        last: (3,) m, written: where ``flange`` is in base.
        out: (12,) written.
    """
    x0, x1, x2 = c[0, 0], c[0, 3], c[0, 6]
    y0, y1, y2 = c[0, 1], c[0, 4], c[0, 7]
    z0, z1, z2 = c[0, 2], c[0, 5], c[0, 8]
    p0, p1, p2 = c[0, 9], c[0, 10], c[0, 11]
    for i in range(6):
        axis[i, 0], axis[i, 1], axis[i, 2] = z0, z1, z2
        origin[i, 0], origin[i, 1], origin[i, 2] = p0, p1, p2
        s, k = sine[i], cosine[i]
        t0, t1, t2 = k * x0 + s * y0, k * x1 + s * y1, k * x2 + s * y2
        y0, y1, y2 = k * y0 - s * x0, k * y1 - s * x1, k * y2 - s * x2
        x0, x1, x2 = t0, t1, t2
        if weigh:
            m0, m1, m2, m3 = com[i, 0], com[i, 1], com[i, 2], com[i, 3]
            moment[i, 0] = m3 * p0 + x0 * m0 + y0 * m1 + z0 * m2
            moment[i, 1] = m3 * p1 + x1 * m0 + y1 * m1 + z1 * m2
            moment[i, 2] = m3 * p2 + x2 * m0 + y2 * m1 + z2 * m2
            if i == 5:
                f0, f1, f2 = flange[0], flange[1], flange[2]
                last[0] = p0 + x0 * f0 + y0 * f1 + z0 * f2
                last[1] = p1 + x1 * f0 + y1 * f1 + z1 * f2
                last[2] = p2 + x2 * f0 + y2 * f1 + z2 * f2
        n = i + 1
        d0, d1, d2 = c[n, 9], c[n, 10], c[n, 11]
        p0 += x0 * d0 + y0 * d1 + z0 * d2
        p1 += x1 * d0 + y1 * d1 + z1 * d2
        p2 += x2 * d0 + y2 * d1 + z2 * d2
        a, b, e = c[n, 0], c[n, 3], c[n, 6]
        u0, u1, u2 = x0 * a + y0 * b + z0 * e, x1 * a + y1 * b + z1 * e, x2 * a + y2 * b + z2 * e
        a, b, e = c[n, 1], c[n, 4], c[n, 7]
        v0, v1, v2 = x0 * a + y0 * b + z0 * e, x1 * a + y1 * b + z1 * e, x2 * a + y2 * b + z2 * e
        a, b, e = c[n, 2], c[n, 5], c[n, 8]
        z0, z1, z2 = x0 * a + y0 * b + z0 * e, x1 * a + y1 * b + z1 * e, x2 * a + y2 * b + z2 * e
        x0, x1, x2, y0, y1, y2 = u0, u1, u2, v0, v1, v2
    out[0], out[1], out[2] = x0, y0, z0
    out[3], out[4], out[5] = x1, y1, z1
    out[6], out[7], out[8] = x2, y2, z2
    out[9], out[10], out[11] = p0, p1, p2


@compiled(EXACT)
def joint_torque(
    axis: Array, origin: Array, moment: Array, mass_out: Array, gravity: Array,
    payload: float, centre: Array, wrench: Array, row: int, point: Array, out: Array,
) -> None:  # fmt: skip
    """Writes the torque (6,) N m of link weights, payload and ``wrench[row]`` about the axes."""
    g0, g1, g2 = gravity[0], gravity[1], gravity[2]
    m0, m1, m2 = payload * centre[0], payload * centre[1], payload * centre[2]
    w0, w1, w2 = wrench[row, 0], wrench[row, 1], wrench[row, 2]
    p0, p1, p2 = point[9], point[10], point[11]
    n0 = p1 * w2 - p2 * w1 + wrench[row, 3]
    n1 = p2 * w0 - p0 * w2 + wrench[row, 4]
    n2 = p0 * w1 - p1 * w0 + wrench[row, 5]
    for j in range(6):
        i = 5 - j
        m0 += moment[i, 0]
        m1 += moment[i, 1]
        m2 += moment[i, 2]
        mass = mass_out[i] + payload
        f0, f1, f2 = mass * g0 + w0, mass * g1 + w1, mass * g2 + w2
        o0, o1, o2 = origin[i, 0], origin[i, 1], origin[i, 2]
        t0 = m1 * g2 - m2 * g1 + n0 - (o1 * f2 - o2 * f1)
        t1 = m2 * g0 - m0 * g2 + n1 - (o2 * f0 - o0 * f2)
        t2 = m0 * g1 - m1 * g0 + n2 - (o0 * f1 - o1 * f0)
        out[i] = axis[i, 0] * t0 + axis[i, 1] * t1 + axis[i, 2] * t2


@compiled(EXACT)
def ripple(p: Pack, joints: Array, sine: Array, cosine: Array, out: Array) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to ``out`` (6,) rad.

    Consecutive harmonics by Clenshaw's recurrence, six sums abreast.
    """
    count = p.ripple.shape[0]
    if count == 0:
        return
    if not p.consecutive:
        for i in range(6):
            total = 0.0
            for k in range(count):
                angle = p.harmonics[k] * joints[i]
                total += p.ripple[k, i] * math.sin(angle) + p.ripple[k, i + 6] * math.cos(angle)
            out[i] += total
        return
    for i in range(0, 6, 3):
        s0, s1, s2 = 0.0, 0.0, 0.0  # sums of the sines of three joints, one step back
        c0, c1, c2 = 0.0, 0.0, 0.0
        t0, t1, t2 = 0.0, 0.0, 0.0  # two steps back
        d0, d1, d2 = 0.0, 0.0, 0.0
        e0, e1, e2 = 2.0 * cosine[i], 2.0 * cosine[i + 1], 2.0 * cosine[i + 2]
        for j in range(count):
            k = count - 1 - j
            # What is two steps old is added first: it does not wait for the last product.
            t0, s0 = s0, (p.ripple[k, i] - t0) + e0 * s0
            t1, s1 = s1, (p.ripple[k, i + 1] - t1) + e1 * s1
            t2, s2 = s2, (p.ripple[k, i + 2] - t2) + e2 * s2
            d0, c0 = c0, (p.ripple[k, i + 6] - d0) + e0 * c0
            d1, c1 = c1, (p.ripple[k, i + 7] - d1) + e1 * c1
            d2, c2 = c2, (p.ripple[k, i + 8] - d2) + e2 * c2
        out[i] += sine[i] * s0 + cosine[i] * c0 - d0
        out[i + 1] += sine[i + 1] * s1 + cosine[i + 1] * c1 - d1
        out[i + 2] += sine[i + 2] * s2 + cosine[i + 2] * c2 - d2


@compiled(EXACT)
def _bumps(p: Pack, sine: Array, cosine: Array, whole: Array, value: Array) -> None:
    """Writes exp(-|s - C_m|^2 / 2) to ``value`` (m,), in vector registers; |error| < 1e-14."""
    s, c, k = sine, cosine, p.scale
    s0, s1, s2, s3, s4, s5 = (
        s[0] * k[0], s[1] * k[1], s[2] * k[2], s[3] * k[3], s[4] * k[4], s[5] * k[5],
    )  # fmt: skip
    c0, c1, c2, c3, c4, c5 = (
        c[0] * k[6], c[1] * k[7], c[2] * k[8], c[3] * k[9], c[4] * k[10], c[5] * k[11],
    )  # fmt: skip
    own = -0.5 * (s0 * s0 + s1 * s1 + s2 * s2 + s3 * s3 + s4 * s4 + s5 * s5)
    own -= 0.5 * (c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3 + c4 * c4 + c5 * c5)
    t, bias = p.centres, p.centre_bias
    a0, a1, a2, a3, a4, a5 = t[0], t[1], t[2], t[3], t[4], t[5]
    b0, b1, b2, b3, b4, b5 = t[6], t[7], t[8], t[9], t[10], t[11]
    for m in range(bias.shape[0]):
        x = bias[m] + own + s0 * a0[m] + s1 * a1[m] + s2 * a2[m] + s3 * a3[m] + s4 * a4[m]
        x += s5 * a5[m] + c0 * b0[m] + c1 * b1[m] + c2 * b2[m] + c3 * b3[m] + c4 * b4[m]
        x += c5 * b5[m]
        x = x if x > -700.0 else -700.0
        shifted = x * LOG2E + ROUND
        power = shifted - ROUND
        r = x - power * LN2_HIGH - power * LN2_LOW
        e = 1.0 / 39916800.0
        e = e * r + 1.0 / 3628800.0
        e = e * r + 1.0 / 362880.0
        e = e * r + 1.0 / 40320.0
        e = e * r + 1.0 / 5040.0
        e = e * r + 1.0 / 720.0
        e = e * r + 1.0 / 120.0
        e = e * r + 1.0 / 24.0
        e = e * r + 1.0 / 6.0
        e = e * r + 0.5
        e = e * r + 1.0
        value[m] = e * r + 1.0
        whole[m] = shifted
    exponent, bits = whole.view(np.int64), value.view(np.int64)
    for m in range(bias.shape[0]):
        bits[m] += exponent[m] << 52  # times 2**power: the low bits of shifted hold it


@compiled(SUMS)
def _weighted(weights: Array, value: Array, out: Array) -> None:
    """Writes weights @ value (3,)."""
    a = b = c = 0.0
    w0, w1, w2 = weights[0], weights[1], weights[2]
    for m in range(value.shape[0]):
        a += w0[m] * value[m]
        b += w1[m] * value[m]
        c += w2[m] * value[m]
    out[0], out[1], out[2] = a, b, c


@compiled(EXACT)
def smooth(p: Pack, sine: Array, cosine: Array, power: Array, value: Array, out: Array) -> None:
    """Writes the smooth residual (3,) m; ``power`` and ``value`` (m,) are work."""
    if p.centre_bias.shape[0] == 0:
        out[0], out[1], out[2] = 0.0, 0.0, 0.0
        return
    _bumps(p, sine, cosine, power, value)
    _weighted(p.weights, value, out)


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
def jacobian(p: Pack, axis: Array, origin: Array, pose: Array, out: Array) -> None:
    """Writes dx/dq (6, 6) of the tool point, linear rows divided by ``length``."""
    scale = 1.0 / p.length
    for i in range(6):
        a0, a1, a2 = axis[i, 0], axis[i, 1], axis[i, 2]
        r0, r1, r2 = pose[9] - origin[i, 0], pose[10] - origin[i, 1], pose[11] - origin[i, 2]
        out[0, i] = (a1 * r2 - a2 * r1) * scale
        out[1, i] = (a2 * r0 - a0 * r2) * scale
        out[2, i] = (a0 * r1 - a1 * r0) * scale
        out[3, i], out[4, i], out[5, i] = a0, a1, a2
    if p.coupled:
        couple_rows(p.coupling, out)
    for i in range(6):
        gain = 1.0 + p.gear[i]
        for k in range(6):
            out[k, i] *= gain


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
def mix_back(matrix: Array, vector: Array) -> None:
    """Replaces a vector (6,) by its product with the transposed matrix."""
    v0, v1, v2, v3, v4, v5 = vector[0], vector[1], vector[2], vector[3], vector[4], vector[5]
    for i in range(6):
        vector[i] = (
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
