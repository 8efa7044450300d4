"""Compiled carrying of a side vector along tool axes: every point needs the one before."""

from __future__ import annotations

import math

from robotrue.core.arrays import Array
from robotrue.core.compiled import PLAIN, compile_kernel


@compile_kernel(PLAIN)
def carry_sides(axis: Array, before: Array, sides: Array) -> None:
    """Carries a side vector along axes by the smallest rotations, in place.

    Args:
        axis: (n, 3) unit vectors.
        before: (3,) the axis that ``sides[0]`` is across when it comes in.
        sides: (n, 3) written; the first row holds the side to begin with.
    """
    x, y, z = sides[0, 0], sides[0, 1], sides[0, 2]
    a, b, c = before[0], before[1], before[2]
    for row in range(len(axis)):
        u, v, w = axis[row, 0], axis[row, 1], axis[row, 2]
        if u != a or v != b or w != c:
            cosine = a * u + b * v + c * w
            if cosine > -1.0 + 1e-9:  # else any half turn is valid, and the side stays
                p, q, r = b * w - c * v, c * u - a * w, a * v - b * u
                i, j, k = q * z - r * y, r * x - p * z, p * y - q * x
                scale = 1.0 / (1.0 + cosine)
                x += i + scale * (q * k - r * j)
                y += j + scale * (r * i - p * k)
                z += k + scale * (p * j - q * i)
            off = x * u + y * v + z * w  # rounding
            x, y, z = x - off * u, y - off * v, z - off * w
            length = math.sqrt(x * x + y * y + z * z)
            x, y, z = x / length, y / length, z / length
            a, b, c = u, v, w
        sides[row, 0], sides[row, 1], sides[row, 2] = x, y, z
