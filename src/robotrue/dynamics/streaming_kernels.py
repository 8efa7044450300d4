"""The recursion of the modal filters in machine code, oscillators side by side in vector registers.

All a filter knows is one array, so that a call with one sample costs little more than the sample:
``ROWS`` rows of K numbers, K a multiple of ``LANES`` and padded with zeros, then twelve numbers::

    0, 1         e^(pT), real and imaginary part
    2 .. 4       what the force x, y, z of the last sample adds to the real part
    5 .. 7       the same to the imaginary part
    8 .. 10      2 Re(u): real part of the state to x, y, z
    11 .. 13     -2 Im(u): imaginary part of the state to x, y, z
    14, 15       the state, real and imaginary part
    then         displacement over force at once (3, 3) m/N by rows; last force (3,) N
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import SUMS, compiled

LANES: Final = 4
ROWS: Final = 16
TAIL: Final = 12
DONE, NOT_FINITE, SHAPE = 0, 1, 2


@compiled(SUMS)
def run(memory: Array, force: Array, out: Array) -> int:
    """Writes the displacement of each sample to ``out`` and moves the state on.

    Returns ``DONE``; or, with nothing done, ``NOT_FINITE`` if a force is not and ``SHAPE`` if
    force and out are not (n, 3) both.

    Args:
        memory: (16 K + 12,).
        force: (n, 3) N, contiguous.
        out: (n, 3) m, contiguous.
    """
    if force.shape[1] != 3 or out.shape[1] != 3 or len(out) != len(force):
        return SHAPE
    sound = 0.0
    for n in range(len(force)):  # NaN and infinity stay, anything else becomes zero
        sound += (force[n, 0] + force[n, 1] + force[n, 2]) * 0.0
    if not np.isfinite(sound):
        return NOT_FINITE
    m = (len(memory) - 12) // 16
    r, s, tail = 14 * m, 15 * m, 16 * m
    fx, fy, fz = memory[tail + 9], memory[tail + 10], memory[tail + 11]
    for n in range(len(force)):
        x = 0.0
        y = 0.0
        z = 0.0
        for k in range(m):
            er, ei, re, im = memory[k], memory[k + m], memory[k + r], memory[k + s]
            a = memory[k + 2 * m] * fx + memory[k + 3 * m] * fy + memory[k + 4 * m] * fz
            b = memory[k + 5 * m] * fx + memory[k + 6 * m] * fy + memory[k + 7 * m] * fz
            a += er * re - ei * im
            b += er * im + ei * re
            memory[k + r] = a
            memory[k + s] = b
            x += memory[k + 8 * m] * a + memory[k + 11 * m] * b
            y += memory[k + 9 * m] * a + memory[k + 12 * m] * b
            z += memory[k + 10 * m] * a + memory[k + 13 * m] * b
        fx, fy, fz = force[n, 0], force[n, 1], force[n, 2]
        x += memory[tail] * fx + memory[tail + 1] * fy + memory[tail + 2] * fz
        y += memory[tail + 3] * fx + memory[tail + 4] * fy + memory[tail + 5] * fz
        z += memory[tail + 6] * fx + memory[tail + 7] * fy + memory[tail + 8] * fz
        out[n, 0], out[n, 1], out[n, 2] = x, y, z
    memory[tail + 9], memory[tail + 10], memory[tail + 11] = fx, fy, fz
    return DONE
