"""KUKA A, B, C of a million targets: the conversions of core.rotations, compiled, row by row.

Same formulas, same branches; their definition is in :mod:`robotrue.core.rotations`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.compiled import EXACT, PLAIN, compile_kernel
from robotrue.core.sines import LARGEST, arc_tangents, sines

_ABREAST: Final = 64
"""Rows whose sines are computed at a time."""


def matrices_from_abc(abc: Array, unit: float) -> Array:
    """Returns R = Rz(A) Ry(B) Rx(C), shape (n, 3, 3), from (n, 3) A, B, C in ``unit`` rad."""
    out = np.empty((len(abc), 3, 3))
    _matrices(abc, unit, out, np.zeros(3 * _ABREAST), np.zeros(6 * _ABREAST))
    return out


@compile_kernel(EXACT)
def _matrices(abc: Array, unit: float, out: Array, angle: Array, trig: Array) -> None:
    for first in range(0, len(abc), _ABREAST):
        count = min(_ABREAST, len(abc) - first)
        for n in range(count):
            for j in range(3):
                angle[j * _ABREAST + n] = abc[first + n, j] * unit
        sines(angle, 3 * _ABREAST, trig)
        for n in range(3 * _ABREAST):
            if abs(angle[n]) > LARGEST:
                trig[n], trig[3 * _ABREAST + n] = math.sin(angle[n]), math.cos(angle[n])
        for n in range(count):
            _matrix(trig, n, out, first + n)


@compile_kernel(EXACT, inline=True)
def _matrix(trig: Array, n: int, out: Array, i: int) -> None:
    """Writes one matrix from the sines and cosines of A, B, C in column ``n``."""
    sa, sb, sc = trig[n], trig[_ABREAST + n], trig[2 * _ABREAST + n]
    ca, cb, cc = trig[3 * _ABREAST + n], trig[4 * _ABREAST + n], trig[5 * _ABREAST + n]
    out[i, 0, 0] = ca * cb
    out[i, 0, 1] = ca * sb * sc - sa * cc
    out[i, 0, 2] = ca * sb * cc + sa * sc
    out[i, 1, 0] = sa * cb
    out[i, 1, 1] = sa * sb * sc + ca * cc
    out[i, 1, 2] = sa * sb * cc - ca * sc
    out[i, 2, 0] = -sb
    out[i, 2, 1] = cb * sc
    out[i, 2, 2] = cb * cc


@compile_kernel(PLAIN, inline=True)
def _wrap(angle: float) -> float:
    """Returns the angle in [-pi, pi), rad; NaN for one too large to have a place in the turn."""
    if -math.pi <= angle < math.pi:
        return angle
    wrapped = angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
    return wrapped if abs(wrapped) < 4.0 else math.nan


def abc_from_matrices(rotation: Array, near: Array) -> Array:
    """Returns (n, 3) A, B, C in rad of (n, 3, 3), each nearest to the (n, 3) of ``near``."""
    out = np.array(near)
    renew_abc(rotation, np.arange(len(rotation)), out, 1.0)
    return out


def renew_abc(rotation: Array, rows: IntArray, abc: Array, unit: float) -> None:
    """Replaces A, B, C in ``unit`` rad of some rows by those of (n, 3, 3) nearest to them.

    Args:
        rotation: Matrices, one for every row.
        rows: The rows to replace.
        abc: A, B, C in its last three columns; renewed in place.
        unit: rad.
    """
    _renew(rotation, rows, abc, unit, np.zeros(12 * _ABREAST))


@compile_kernel(EXACT)
def _renew(rotation: Array, rows: IntArray, abc: Array, unit: float, work: Array) -> None:
    for first in range(0, len(rows), _ABREAST):
        count = min(_ABREAST, len(rows) - first)
        _hand_in(rotation, rows, first, count, abc, unit, work)
        arc_tangents(work, 0, 3 * _ABREAST, 3 * _ABREAST, 6 * _ABREAST)
        for n in range(count):
            i = rows[first + n]
            a, b, c = (
                work[6 * _ABREAST + n], work[7 * _ABREAST + n], work[8 * _ABREAST + n],
            )  # fmt: skip
            near_a, near_b, near_c = (
                work[9 * _ABREAST + n], work[10 * _ABREAST + n], work[11 * _ABREAST + n],
            )  # fmt: skip
            if work[4 * _ABREAST + n] < 1e-12:
                a, c = _split_locked(rotation[i], b, near_a, near_c)
            a, b, c = _nearest(a, b, c, near_a, near_b, near_c)
            at = abc.shape[1] - 3
            abc[i, at], abc[i, at + 1], abc[i, at + 2] = a / unit, b / unit, c / unit


@compile_kernel(EXACT)
def _hand_in(
    rotation: Array, rows: IntArray, first: int, count: int, abc: Array, unit: float, work: Array
) -> None:
    """Writes sines and cosines of A, B, C (six rows), and from the ninth row on A, B, C in rad."""
    for n in range(count):
        i = rows[first + n]
        r = rotation[i]
        work[n], work[3 * _ABREAST + n] = r[1, 0], r[0, 0]
        work[_ABREAST + n] = -r[2, 0]
        work[4 * _ABREAST + n] = math.sqrt(r[0, 0] * r[0, 0] + r[1, 0] * r[1, 0])
        work[2 * _ABREAST + n], work[5 * _ABREAST + n] = r[2, 1], r[2, 2]
        for j in range(3):
            work[(9 + j) * _ABREAST + n] = abc[i, abc.shape[1] - 3 + j] * unit


@compile_kernel(PLAIN, inline=True)
def _split_locked(r: Array, b: float, near_a: float, near_c: float) -> tuple[float, float]:
    """Returns A and C at the lock: R depends on A - sign * C alone, the turn is split evenly."""
    sign = 1.0 if b > 0 else -1.0
    difference = math.atan2(-r[0, 1], r[1, 1])
    split = _wrap(difference - (near_a - sign * near_c)) / 2.0
    return near_a + split, near_c - sign * split


@compile_kernel(PLAIN, inline=True)
def _nearest(
    a: float, b: float, c: float, near_a: float, near_b: float, near_c: float
) -> tuple[float, float, float]:
    """Returns the triple or its other form, whichever is nearer, at the nearest turns."""
    a1, b1, c1 = _wrap(a - near_a), _wrap(b - near_b), _wrap(c - near_c)
    if not a1 * a1 + b1 * b1 + c1 * c1 < 1.0:  # else the other form is half a turn away
        a2 = _wrap(a + math.pi - near_a)
        b2 = _wrap(math.pi - b - near_b)
        c2 = _wrap(c + math.pi - near_c)
        if a2 * a2 + b2 * b2 + c2 * c2 < a1 * a1 + b1 * b1 + c1 * c1:
            a1, b1, c1 = a2, b2, c2
    return near_a + a1, near_b + b1, near_c + c1
