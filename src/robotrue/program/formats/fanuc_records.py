"""Plain Fanuc LS position records, with group 1 alone and six numbers, read by a compiled loop."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compiled
from robotrue.program.formats.krl_tokens import read_number

CURRENT: Final = -1
"""UF or UT that is written ``F``: the number in force."""
COLUMNS: Final = 7
"""Number, first byte, kind, first byte and length of CONFIG (-1, 0 without), UF, UT."""
_POSE: Final = np.frombuffer(b"XYZWPR", np.uint8)


@compiled(PLAIN)
def plain_records(
    buf: Bytes, at: int, end: int, table: IntArray, spans: IntArray, value: Array
) -> tuple[int, int]:
    """Fills rows from the records at ``at``, up to one that is not plain.

    Args:
        buf: The bytes of the program.
        at: Where to begin.
        end: Where the positions end.
        table: (m, COLUMNS).
        spans: (m, 6, 2) gets first and last byte of the numbers.
        value: (m, 6) gets the numbers.

    Returns:
        How many rows were filled, and the place after the last of them.
    """
    rows = 0
    while rows < len(table):
        k = _head(buf, at, end, table[rows])
        k = _frames(buf, k, end, table[rows])
        k = _numbers(buf, k, end, table[rows], spans[rows], value[rows])
        k = _sign(buf, _sign(buf, k, end, 125), end, 59)
        if k < 0:
            break
        rows += 1
        at = k
    return rows, at


@compiled(PLAIN)
def _head(buf: Bytes, k: int, end: int, row: IntArray) -> int:
    """Reads ``P[n:"name"]{ GP1:`` and returns what follows, -1 if it does not stand there."""
    k = _sign(buf, k, end, 80)
    place = k - 1
    number, k = _whole(buf, _sign(buf, k, end, 91), end, 6)
    k = _blank(buf, k, end)
    if 0 <= k < end and buf[k] == 58:
        while k < end and buf[k] != 93 and buf[k] != 10 and buf[k] != 13:
            k += 1
    k = _sign(buf, _sign(buf, k, end, 93), end, 123)
    k = _next(buf, _sign(buf, k, end, 71), end, 80)
    group, k = _whole(buf, k, end, 2)
    row[0], row[1] = number, place
    return _sign(buf, k, end, 58) if group == 1 else -1


@compiled(PLAIN)
def _frames(buf: Bytes, k: int, end: int, row: IntArray) -> int:
    """Reads ``UF : 1, UT : 1,`` and CONFIG if it is there."""
    for column, letter in ((5, 70), (6, 84)):
        k = _next(buf, _sign(buf, k, end, 85), end, letter)
        k = _blank(buf, _sign(buf, k, end, 58), end)
        if 0 <= k < end and buf[k] == 70:
            row[column], k = CURRENT, k + 1
        else:
            row[column], k = _whole(buf, k, end, 9)
        k = _sign(buf, k, end, 44)
    row[3], row[4] = -1, 0
    j = k
    for c in b"CONFIG":
        j = _next(buf, _blank(buf, j, end) if c == 67 else j, end, c)
    if j < 0:
        return k
    j = _sign(buf, _sign(buf, j, end, 58), end, 39)
    start = j
    while 0 <= j < end and buf[j] != 39 and buf[j] != 10 and buf[j] != 13:
        j += 1
    row[3], row[4] = start, j - start
    return _sign(buf, _next(buf, j, end, 39), end, 44)


@compiled(PLAIN)
def _numbers(buf: Bytes, k: int, end: int, row: IntArray, spans: IntArray, value: Array) -> int:
    """Reads X Y Z W P R or J1 to J6 with their units."""
    k = _blank(buf, k, end)
    axes = 0 <= k < end and buf[k] == 74
    row[2] = 1 if axes else 0
    for i in range(6):
        if i > 0:
            k = _sign(buf, k, end, 44)
        k = _blank(buf, k, end)
        if axes:
            k = _next(buf, _next(buf, k, end, 74), end, 49 + i)
        else:
            k = _next(buf, k, end, _POSE[i])
        k = _blank(buf, _sign(buf, k, end, 61), end)
        if k < 0:
            return -1
        number, last = read_number(buf, k, end)
        if last == k or not np.isfinite(number):
            return -1
        for j in range(k, last):
            if buf[j] == 32 or buf[j] == 9:  # KRL has blanks before an exponent, LS has not
                return -1
        spans[i, 0], spans[i, 1], value[i] = k, last, number
        k = _blank(buf, last, end)
        if axes or i > 2:
            k = _next(buf, _next(buf, _next(buf, k, end, 100), end, 101), end, 103)
        else:
            k = _next(buf, _next(buf, k, end, 109), end, 109)
    return k


@compiled(PLAIN)
def _blank(buf: Bytes, k: int, end: int) -> int:
    while 0 <= k < end and (buf[k] == 32 or 9 <= buf[k] <= 13):
        k += 1
    return k


@compiled(PLAIN)
def _next(buf: Bytes, k: int, end: int, sign: int) -> int:
    """Returns what follows a sign that stands at ``k``, -1 if it does not."""
    return k + 1 if 0 <= k < end and buf[k] == sign else -1


@compiled(PLAIN)
def _sign(buf: Bytes, k: int, end: int, sign: int) -> int:
    """As :func:`_next`, blanks before the sign allowed."""
    return _next(buf, _blank(buf, k, end), end, sign)


@compiled(PLAIN)
def _whole(buf: Bytes, k: int, end: int, most: int) -> tuple[int, int]:
    """Returns a whole number of at most so many digits, -1 if there is none, and what follows."""
    k = _blank(buf, k, end)
    number, first = 0, k
    while 0 <= k < end and 48 <= buf[k] <= 57 and k - first < most:
        number = 10 * number + buf[k] - 48
        k += 1
    if k <= first:
        return -1, -1
    return number, k
