"""Compiled sines, cosines, arc tangents and exponentials of many numbers, in vector registers."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compile_kernel

TWO_OVER_PI: Final = 2.0 / math.pi
HALF_PI_HIGH: Final = float.fromhex("0x1.921fb54400000p+0")
"""33 bits: exact times any small integer."""
HALF_PI_LOW: Final = float.fromhex("0x1.0b4611a626331p-34")
ROUND: Final = 6755399441055744.0
"""1.5 * 2**52: adding it leaves the nearest integer in the low bits."""
TANGENT: Final = math.tan(math.pi / 8.0)
LARGEST: Final = 1e5
"""rad up to which the error holds."""

LOWEST: Final = -700.0
"""Numbers below it are taken as it: their exponentials are zero for all purposes."""
LOG2E: Final = 1.0 / math.log(2.0)
LN2_HIGH: Final = float.fromhex("0x1.62e42fee00000p-1")
LN2_LOW: Final = float.fromhex("0x1.a39ef35793c76p-33")
MANTISSA_BITS: Final = 52


@compile_kernel(EXACT, inline=True)
def sine_and_cosine(angle: float) -> tuple[float, float]:
    """Returns both; |error| < 2e-16.

    Angles up to ``LARGEST``: quarter turns are subtracted in two parts; Taylor series give the
    remainder.
    """
    k = (angle * TWO_OVER_PI + ROUND) - ROUND
    r = (angle - k * HALF_PI_HIGH) - k * HALF_PI_LOW
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
    return (
        -sine if (quarter < -0.5 or quarter > 1.5) else sine,
        -cosine if (quarter > 0.5 or quarter < -1.5) else cosine,
    )


@compile_kernel(EXACT, inline=True)
def sines(angle: Array, count: int, out: Array) -> None:
    """Writes the sines of ``count`` angles, then their cosines, to ``out``; |error| < 2e-16."""
    for n in range(count):
        out[n], out[count + n] = sine_and_cosine(angle[n])


@compile_kernel(EXACT)
def write_sines(angle: Array, sine: Array, cosine: Array) -> None:
    """Writes sine and cosine of all angles; |error| < 2e-16."""
    for n in range(len(angle)):
        sine[n], cosine[n] = sine_and_cosine(angle[n])


@compile_kernel(EXACT, inline=True)
def arc_tangent(y: float, x: float) -> float:
    """Returns atan2(y, x) in rad; |error| < 5e-16. Two zeros give zero, what is not finite NaN.

    A polynomial is used up to a sixteenth of a turn, reflections beyond.
    """
    steep = abs(y) > abs(x)
    large, small = abs(y) if steep else abs(x), abs(x) if steep else abs(y)
    beyond = small > TANGENT * large
    base = small + large if beyond else large
    t = (small - large if beyond else small) / (base if base > 0.0 else 1.0)
    z = t * t
    u = z * -0.019176885636589053 + 0.039231657085083686
    u = u * z - 0.050854496960392584
    u = u * z + 0.05858148904795124
    u = u * z - 0.0666451144646022
    u = u * z + 0.07692183190760651
    u = u * z - 0.09090904578121085
    u = u * z + 0.11111111015256292
    u = u * z - 0.14285714284666542
    u = u * z + 0.1999999999999552
    u = u * z - 0.3333333333333333
    u = u * (z * t) + t
    u = 0.25 * math.pi + u if beyond else u
    u = 0.5 * math.pi - u if steep else u
    u = math.pi - u if x < 0.0 else u
    return (-u if y < 0.0 else u) + ((x - x) + (y - y))


@compile_kernel(EXACT, inline=True)
def arc_tangents(rows: Array, sine: int, cosine: int, count: int, out: int) -> None:
    """Writes atan2 of ``count`` sines and cosines, in rad.

    ``sine``, ``cosine`` and ``out`` are where each begins in ``rows``.
    """
    for n in range(count):
        rows[out + n] = arc_tangent(rows[sine + n], rows[cosine + n])


@compile_kernel(EXACT)
def exponentials(values: Array, spare: Array) -> None:
    """Replaces numbers up to 700 by their exponentials; relative error < 1e-14.

    Powers of two are split off in two parts; a Taylor series gives the remainder. The powers are
    the low bits stored in ``spare``, as long as ``values``: registers convert no floats to
    integers.
    """
    for m in range(len(values)):
        x = values[m] if values[m] > LOWEST else LOWEST
        spare[m] = x * LOG2E + ROUND
        power = spare[m] - ROUND
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
        values[m] = e * r + 1.0
    bits, powers = values.view(np.int64), spare.view(np.int64)
    for m in range(len(values)):
        bits[m] += powers[m] << MANTISSA_BITS  # times 2**power
