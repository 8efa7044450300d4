"""The recursion of the modal filters in machine code, oscillators side by side in vector registers.

Rows of ``coefficients`` (14, K), K a multiple of ``LANES``, padded with zeros::

    0, 1         e^(pT), real and imaginary part
    2 .. 4       what the force x, y, z of the last sample adds to the real part
    5 .. 7       the same to the imaginary part
    8 .. 10      2 Re(u): real part of the state to x, y, z
    11 .. 13     -2 Im(u): imaginary part of the state to x, y, z

``state`` is (2 K + 3,): real parts, imaginary parts, last force.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import SUMS, compiled

LANES: Final = 4
ROWS: Final = 14


@compiled(SUMS)
def run(coefficients: Array, through: Array, state: Array, force: Array, out: Array) -> bool:
    """Writes the displacement of each sample to ``out`` and moves the state on.

    Returns whether every force was finite; where one was not, nothing has been done.

    Args:
        coefficients: (14, K).
        through: (3, 3) m/N, what follows the force at once.
        state: (2 K + 3,), moved on.
        force: (n, 3) N, contiguous.
        out: (n, 3) m, contiguous.
    """
    sound = 0.0
    for n in range(len(force)):  # NaN and infinity stay, anything else becomes zero
        sound += (force[n, 0] + force[n, 1] + force[n, 2]) * 0.0
    if not np.isfinite(sound):
        return False
    lanes = coefficients.shape[1]
    er, ei = coefficients[0], coefficients[1]
    ax, ay, az = coefficients[2], coefficients[3], coefficients[4]
    bx, by, bz = coefficients[5], coefficients[6], coefficients[7]
    rx, ry, rz = coefficients[8], coefficients[9], coefficients[10]
    ix, iy, iz = coefficients[11], coefficients[12], coefficients[13]
    real, imag = state[:lanes], state[lanes : 2 * lanes]
    fx, fy, fz = state[2 * lanes], state[2 * lanes + 1], state[2 * lanes + 2]
    d00, d01, d02 = through[0, 0], through[0, 1], through[0, 2]
    d10, d11, d12 = through[1, 0], through[1, 1], through[1, 2]
    d20, d21, d22 = through[2, 0], through[2, 1], through[2, 2]
    for n in range(len(force)):
        x = 0.0
        y = 0.0
        z = 0.0
        for k in range(lanes):
            re, im = real[k], imag[k]
            a = er[k] * re - ei[k] * im + (ax[k] * fx + ay[k] * fy + az[k] * fz)
            b = er[k] * im + ei[k] * re + (bx[k] * fx + by[k] * fy + bz[k] * fz)
            real[k] = a
            imag[k] = b
            x += rx[k] * a + ix[k] * b
            y += ry[k] * a + iy[k] * b
            z += rz[k] * a + iz[k] * b
        fx, fy, fz = force[n, 0], force[n, 1], force[n, 2]
        out[n, 0] = x + (d00 * fx + d01 * fy + d02 * fz)
        out[n, 1] = y + (d10 * fx + d11 * fy + d12 * fz)
        out[n, 2] = z + (d20 * fx + d21 * fy + d22 * fz)
    state[2 * lanes] = fx
    state[2 * lanes + 1] = fy
    state[2 * lanes + 2] = fz
    return True
