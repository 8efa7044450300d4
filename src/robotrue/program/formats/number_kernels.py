"""Compiled printing of numbers into a buffer of bytes, for programs of a million targets."""

from __future__ import annotations

from typing import Any, Final

import numba
import numpy as np

_HALF_DIGIT: Final = np.array([0.5 * 10.0**-k for k in range(16)])
_POWER: Final = np.array([10.0**k for k in range(23)])
SLOW_DECIMALS: Final = 13
"""From here on a number is left to the slow way, which rounds exactly."""


@numba.njit(cache=True)
def put_whole(out: Any, k: Any, whole: Any) -> Any:
    """Writes a non-negative integer at ``k``; returns its end."""
    size, rest = 1, whole // 10
    while rest > 0:
        size += 1
        rest //= 10
    for i in range(size):
        out[k + size - 1 - i] = 48 + whole % 10
        whole //= 10
    return k + size


@numba.njit(cache=True)
def put_number(out: Any, k: Any, value: Any, decimals: Any, plus: Any, bare: Any) -> Any:
    """Writes ``value`` with ``decimals`` at ``k``; returns its end."""
    scale = 1
    for _ in range(decimals):
        scale *= 10
    magnitude = abs(value)
    whole = int(np.floor(magnitude))
    fraction = int(np.rint((magnitude - whole) * scale))
    if fraction >= scale:
        whole, fraction = whole + 1, fraction - scale
    if value < 0 and (whole > 0 or fraction > 0):
        out[k] = 45
        k += 1
    elif plus:
        out[k] = 43
        k += 1
    if whole > 0 or not bare:
        k = put_whole(out, k, whole)
    out[k] = 46
    for i in range(decimals):
        out[k + decimals - i] = 48 + fraction % 10
        fraction //= 10
    return k + 1 + decimals


@numba.njit(cache=True)
def copy_bytes(out: Any, k: Any, buf: Any, start: Any, end: Any) -> Any:
    """Copies ``buf[start:end]`` to ``k``; returns its end."""
    for i in range(start, end):
        out[k] = buf[i]
        k += 1
    return k


@numba.njit(cache=True)
def place(
    out: Any, k: Any, buf: Any, cursor: Any, start: Any, end: Any, text: Any, size: Any
) -> Any:
    """Copies up to a token and writes ``text[:size]``, its column kept where blanks allow."""
    lead = 0
    while start - lead - 1 >= cursor and buf[start - lead - 1] == 32:
        lead += 1
    growth = size - (end - start)
    eat = min(growth, lead - 1) if lead >= 2 and growth > 0 else 0
    k = copy_bytes(out, k, buf, cursor, start - eat)
    if lead >= 2:
        for _ in range(-growth):
            out[k] = 32
            k += 1
    return copy_bytes(out, k, text, 0, size)


@numba.njit(cache=True)
def is_plain(buf: Any, start: Any, end: Any) -> Any:
    """Returns whether a token is digits with at most one point and a sign, and not too long."""
    point = -1
    for i in range(start, end):
        if buf[i] == 46:
            point = i
        elif not (48 <= buf[i] <= 57 or (i == start and (buf[i] == 43 or buf[i] == 45))):
            return False
    return point >= 0 and start < end and end - point <= SLOW_DECIMALS


@numba.njit(cache=True)
def respell(
    buf: Any,
    start: Any,
    length: Any,
    old: Any,
    value: Any,
    enough: Any,
    least: Any,
    slow: Any,
    texts: Any,
    aligned: Any,
    out: Any,
) -> Any:
    """Copies ``buf`` to ``out`` with tokens (t,), in order, rewritten; returns the bytes written.

    A plain token keeps its decimals, or gets ``least`` where it has fewer than ``enough``; it stays
    where it says the value already. Of others ``texts[slow[t] : slow[t + 1]]`` is what to write.
    When ``aligned``, a token keeps its column where the blanks before it allow.
    """
    scratch, cursor, k = np.empty(64, np.uint8), 0, 0
    for t in range(start.size):
        first, last = start[t], start[t] + length[t]
        if slow[t + 1] > slow[t]:
            text, size = texts[slow[t] : slow[t + 1]], slow[t + 1] - slow[t]
        else:
            point = first
            while buf[point] != 46:
                point += 1
            decimals = last - point - 1
            if decimals < enough[t]:
                decimals = max(decimals, least[t])
            if abs(value[t] - old[t]) <= _HALF_DIGIT[decimals]:
                continue
            signed = buf[first] == 43 or buf[first] == 45
            bare = point == first + signed
            text, size = scratch, put_number(scratch, 0, value[t], decimals, buf[first] == 43, bare)
        if not aligned:
            k = copy_bytes(out, k, buf, cursor, first)
            cursor = first
        k = place(out, k, buf, cursor, first, last, text, size)
        cursor = last
    return copy_bytes(out, k, buf, cursor, buf.size)


@numba.njit(cache=True)
def plain_tokens(buf: Any, start: Any, length: Any) -> Any:
    """Returns which tokens (t,) are plain."""
    out = np.empty(start.size, np.bool_)
    for t in range(start.size):
        out[t] = is_plain(buf, start[t], start[t] + length[t])
    return out


@numba.njit(cache=True)
def literal_numbers(
    buf: Any,
    first: Any,
    last: Any,
    kind: Any,
    columns: Any,
    comment: Any,
    start: Any,
    length: Any,
    value: Any,
) -> None:
    """Fills in where the numbers of literals (n,) stand and what they say.

    A value stays NaN where it has more than fifteen digits or a large exponent: only a slow way
    reads it to the last bit.
    """
    for row in range(first.size):
        i, count = first[row], 0
        while i < last[row]:
            c = buf[i]
            if c == comment:
                while i < last[row] and buf[i] != 10 and buf[i] != 13:
                    i += 1
            elif not (48 <= c <= 57 or c == 43 or c == 45 or c == 46):
                i += 1
            else:
                begun = i
                while i < last[row] and (
                    48 <= buf[i] <= 57
                    or buf[i] == 43
                    or buf[i] == 45
                    or buf[i] == 46
                    or (buf[i] | 32) == 101
                ):
                    i += 1
                column = columns[kind[row], count]
                count += 1
                start[row, column], length[row, column] = begun, i - begun
                value[row, column] = _exact(buf, begun, i)


@numba.njit(cache=True)
def _exact(buf: Any, start: Any, end: Any) -> Any:
    """Returns a number that one product or quotient rounds to the last bit, NaN for others."""
    whole, digits, decimals, power, mark = 0, 0, 0, 0, end
    point = False
    for i in range(start, end):
        c = buf[i]
        if 48 <= c <= 57:
            whole = 10 * whole + (c - 48)
            digits += 1
            decimals += point
            if digits > 15:
                return np.nan
        elif c == 46:
            point = True
        elif (c | 32) == 101:
            mark = i
            break
    for i in range(mark + 1, end):
        if 48 <= buf[i] <= 57:
            power = min(10 * power + (buf[i] - 48), 1000)
    if mark + 1 < end and buf[mark + 1] == 45:
        power = -power
    power -= decimals
    if abs(power) > 22:
        return np.nan
    out = whole * _POWER[power] if power >= 0 else whole / _POWER[-power]
    return -out if buf[start] == 45 else out
