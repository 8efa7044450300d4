"""KUKA A, B, C of a million targets: the conversions of core.rotations, compiled, row by row.

Same formulas, same branches; what they mean is told in :mod:`robotrue.core.rotations`.
"""

from __future__ import annotations

import math
from typing import Any, cast

import numba
import numpy as np

from robotrue.core.arrays import Array


def matrices_from_abc(abc: Array, unit: float) -> Array:
    """Returns R = Rz(A) Ry(B) Rx(C), shape (n, 3, 3), from (n, 3) A, B, C in ``unit`` rad."""
    out = np.empty((len(abc), 3, 3))
    _matrices(abc, unit, out)
    return out


@numba.njit(cache=True)
def _matrices(abc: Any, unit: Any, out: Any) -> None:
    for i in range(len(abc)):
        a, b, c = abc[i, 0] * unit, abc[i, 1] * unit, abc[i, 2] * unit
        ca, sa = math.cos(a), math.sin(a)
        cb, sb = math.cos(b), math.sin(b)
        cc, sc = math.cos(c), math.sin(c)
        out[i, 0, 0] = ca * cb
        out[i, 0, 1] = ca * sb * sc - sa * cc
        out[i, 0, 2] = ca * sb * cc + sa * sc
        out[i, 1, 0] = sa * cb
        out[i, 1, 1] = sa * sb * sc + ca * cc
        out[i, 1, 2] = sa * sb * cc - ca * sc
        out[i, 2, 0] = -sb
        out[i, 2, 1] = cb * sc
        out[i, 2, 2] = cb * cc


@numba.njit(cache=True)
def _wrap(angle: Any) -> Any:
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@numba.njit(cache=True)
def nearest_abc(r: Any, near_a: Any, near_b: Any, near_c: Any) -> Any:
    """Returns the (A, B, C) of a 3x3 matrix nearest to the given one, all in rad."""
    cos_b = math.hypot(r[0, 0], r[1, 0])
    b = math.atan2(-r[2, 0], cos_b)
    a, c = near_a, near_c
    if cos_b >= 1e-12:
        a, c = math.atan2(r[1, 0], r[0, 0]), math.atan2(r[2, 1], r[2, 2])
    if cos_b < 1e-3:
        # At the lock R depends on A - sign * C alone, and near it A and C are known to rounding
        # over cos B each, their difference to rounding; what is amiss is split evenly.
        sign = 1.0 if b > 0 else -1.0
        difference = math.atan2(sign * r[1, 2] - r[0, 1], r[1, 1] + sign * r[0, 2])
        split = _wrap(difference - (a - sign * c)) / 2.0
        a, c = a + split, c - sign * split
    a1, b1, c1 = _wrap(a - near_a), _wrap(b - near_b), _wrap(c - near_c)
    a2 = _wrap(a + math.pi - near_a)
    b2 = _wrap(math.pi - b - near_b)
    c2 = _wrap(c + math.pi - near_c)
    if a2 * a2 + b2 * b2 + c2 * c2 < a1 * a1 + b1 * b1 + c1 * c1:
        a1, b1, c1 = a2, b2, c2
    return near_a + a1, near_b + b1, near_c + c1


def abc_from_matrices(rotation: Array, near: Array) -> Array:
    """Returns (n, 3) A, B, C in rad of (n, 3, 3), each nearest to the (n, 3) of ``near``."""
    return cast(Array, _all_nearest(rotation, near))


@numba.njit(cache=True)
def _all_nearest(rotation: Any, near: Any) -> Any:
    out = np.empty_like(near)
    for i in range(len(near)):
        out[i] = nearest_abc(rotation[i], near[i, 0], near[i, 1], near[i, 2])
    return out
