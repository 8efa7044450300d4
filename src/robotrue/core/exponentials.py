"""Compiled exponentials of many numbers, in vector registers."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compiled
from robotrue.core.sines import ROUND

LOWEST: Final = -700.0
"""Numbers below it are taken as it: their exponentials are zero for all purposes."""
LOG2E: Final = 1.0 / math.log(2.0)
LN2_HIGH: Final = float.fromhex("0x1.62e42fee00000p-1")
LN2_LOW: Final = float.fromhex("0x1.a39ef35793c76p-33")
MANTISSA_BITS: Final = 52


@compiled(EXACT)
def exponentials(values: Array, spare: Array) -> None:
    """Replaces numbers up to 700 by their exponentials; relative error < 1e-14.

    Powers of two are taken off in two parts; a Taylor series does the rest. The powers are the low
    bits of what ``spare``, as long as ``values``, keeps: registers convert no floats to integers.
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
