"""Compiled printing of numbers into a buffer of bytes, for programs of a million targets."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel

_HALF_DIGIT: Final = np.array([0.5 * 10.0**-k for k in range(16)])
_TENS: Final = np.array([10**k for k in range(19)])
_PAIRS: Final = np.frombuffer(b"".join(b"%02d" % k for k in range(100)), np.uint8)
_TEN: Final = np.uint64(10)
_HUNDRED: Final = np.uint64(100)
_ROUND: Final = 2.0**52
"""Adding and taking it off again leaves the nearest integer, the even one of two."""
_POWER: Final = np.array([10.0**k for k in range(23)])
_QUICK: Final = 1e8
"""Values below this are printed by the compiled way."""
SLOW_DECIMALS: Final = 13
"""From here on a number is left to the slow way, which rounds exactly."""


@compile_kernel(PLAIN)
def put_whole(out: Bytes, k: int, whole: int) -> int:
    """Writes a non-negative integer at ``k``; returns its end."""
    size = 1
    while size < 19 and whole >= _TENS[size]:
        size += 1
    _put_digits(out, k, np.uint64(whole), size)
    return k + size


@compile_kernel(PLAIN)
def _put_digits(out: Bytes, k: int, rest: np.uint64, size: int) -> None:
    """Writes the last ``size`` digits of an unsigned integer from ``k`` on, two at a time."""
    end = k + size
    while end > k + 1:
        above = rest // _HUNDRED
        two = 2 * np.int64(rest - above * _HUNDRED)
        out[end - 2], out[end - 1] = _PAIRS[two], _PAIRS[two + 1]
        rest, end = above, end - 2
    if end > k:
        out[k] = 48 + np.int64(rest % _TEN)


@compile_kernel(PLAIN, inline=True)
def put_number(out: Bytes, k: int, value: float, decimals: int, plus: bool, bare: bool) -> int:
    """Writes ``value`` with ``decimals`` at ``k``; returns its end."""
    scale = _TENS[decimals]
    magnitude = abs(value)
    whole = int(magnitude)
    fraction = int(((magnitude - whole) * scale + _ROUND) - _ROUND)
    if fraction >= scale:
        whole, fraction = whole + 1, fraction - scale
    negative = value < 0 and (whole > 0 or fraction > 0)
    if negative or plus:
        out[k] = 45 if negative else 43
        k += 1
    if not bare or whole > 0:
        k = put_whole(out, k, whole)
    out[k] = 46
    _put_digits(out, k + 1, np.uint64(fraction), decimals)
    return k + 1 + decimals


@compile_kernel(PLAIN)
def copy_bytes(out: Bytes, k: int, buf: Bytes, start: int, end: int) -> int:
    """Copies ``buf[start:end]`` to ``k``; returns its end."""
    for i in range(start, end):
        out[np.uint64(k)] = buf[np.uint64(i)]
        k += 1
    return k


@compile_kernel(PLAIN)
def place(
    out: Bytes, k: int, buf: Bytes, cursor: int, start: int, end: int, text: Bytes, size: int
) -> int:
    """Copies up to a token and writes ``text[:size]``, in the same column where blanks permit."""
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


@compile_kernel(PLAIN)
def is_plain(buf: Bytes, start: int, end: int) -> bool:
    """Returns whether a token is digits with at most one point and a sign, and not too long."""
    point = -1
    for i in range(start, end):
        if buf[i] == 46:
            point = i
        elif not (48 <= buf[i] <= 57 or (i == start and (buf[i] == 43 or buf[i] == 45))):
            return False
    return point >= 0 and start < end and end - point <= SLOW_DECIMALS


@compile_kernel(PLAIN)
def respell(
    buf: Bytes,
    index: IntArray,
    start: IntArray,
    length: IntArray,
    old: Array,
    value: Array,
    enough: IntArray,
    least: IntArray,
    slow: IntArray,
    texts: Bytes,
    aligned: bool,
    out: Bytes,
) -> int:
    """Copies ``buf`` to ``out`` with tokens rewritten; returns the bytes written.

    ``index`` (t,) are the tokens in the order of the bytes, places in the tables after it. A plain
    token keeps its decimals, or gets ``least`` where it has fewer than ``enough``; it stays where
    it equals the value already. Of others ``texts[slow[t] : slow[t + 1]]`` is what to write. When
    ``aligned``, a token keeps its column where the blanks before it allow.
    """
    scratch, cursor, k = np.empty(64 + texts.size, np.uint8), 0, 0
    for t in range(index.size):
        i = np.uint64(index[t])
        first, last = start[i], start[i] + length[i]
        odd, decimals, plus, bare = slow[t + 1] > slow[t], 0, False, False
        if not odd:
            point = first
            while buf[np.uint64(point)] != 46:
                point += 1
            decimals = last - point - 1
            if decimals < enough[i]:
                decimals = max(decimals, least[i])
            if abs(value[i] - old[i]) <= _HALF_DIGIT[np.uint64(decimals)]:
                continue
            plus = buf[first] == 43
            bare = point == first + (plus or buf[first] == 45)
        if aligned and first - 2 >= cursor and buf[first - 1] == 32 and buf[first - 2] == 32:
            if odd:
                size = slow[t + 1] - slow[t]
                copy_bytes(scratch, 0, texts, slow[t], slow[t + 1])
            else:
                size = put_number(scratch, 0, value[i], decimals, plus, bare)
            k = place(out, k, buf, cursor, first, last, scratch, size)
        else:
            k = copy_bytes(out, k, buf, cursor, first)
            if odd:
                k = copy_bytes(out, k, texts, slow[t], slow[t + 1])
            else:
                k = put_number(out, k, value[i], decimals, plus, bare)
        cursor = last
    return copy_bytes(out, k, buf, cursor, buf.size)


@compile_kernel(PLAIN, inline=True)
def _in_a_name(byte: int) -> bool:
    """Returns whether a digit after the byte would be a part of a name."""
    return 48 <= byte <= 57 or 65 <= (byte & 223) <= 90 or byte == 95


@compile_kernel(PLAIN)
def pick_tokens(
    buf: Bytes,
    start: IntArray,
    length: IntArray,
    touched: BoolArray,
    value: Array,
    picked: IntArray,
    odd: IntArray,
    joined: BoolArray,
) -> tuple[int, bool]:
    """Lists the touched tokens (n, w) row by row; returns how many, and whether they rise.

    Args:
        buf: The bytes.
        start: First byte of each; below 0 where there is none.
        length: Bytes of each.
        touched: Those to list.
        value: New value of each.
        picked: (t,) place of each in the tables.
        odd: (t,) 1 where it is not plain, or not below 1e8.
        joined: (t,) a digit in the place of its first byte would belong to the name before it.
    """
    count, before, rising = 0, -1, True
    for row in range(start.shape[0]):
        for column in range(start.shape[1]):
            first = start[row, column]
            if not touched[row, column] or first < 0:
                continue
            rising &= first > before
            before = first
            picked[count] = row * start.shape[1] + column
            plain = is_plain(buf, first, first + length[row, column])
            odd[count] = not (plain and abs(value[row, column]) < _QUICK)
            joined[count] = first > 0 and _in_a_name(buf[first - 1])
            count += 1
    return count, rising


@compile_kernel(PLAIN)
def literal_numbers(
    buf: Bytes,
    first: IntArray,
    last: IntArray,
    kind: IntArray,
    columns: IntArray,
    comment: int,
    start: IntArray,
    length: IntArray,
) -> None:
    """Fills in the places of the numbers of literals (n,)."""
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


@compile_kernel(PLAIN)
def token_values(buf: Bytes, start: IntArray, length: IntArray) -> Array:
    """Returns the values of numbers (n, w), NaN where absent.

    NaN as well where one has more than fifteen digits or a large exponent: only a slow way reads
    it to the last bit.
    """
    value = np.full(start.shape, np.nan)
    for row in range(start.shape[0]):
        for column in range(start.shape[1]):
            first = start[row, column]
            if first >= 0:
                value[row, column] = _exact(buf, first, first + length[row, column])
    return value


@compile_kernel(PLAIN)
def _exact(buf: Bytes, start: int, end: int) -> float:
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
    out: float = whole * _POWER[power] if power >= 0 else whole / _POWER[-power]
    return -out if buf[start] == 45 else out
