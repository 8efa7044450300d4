"""Plain Fanuc LS position records, with group 1 alone and six numbers, read by a compiled loop."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.program.formats.krl_tokens import read_number

CURRENT: Final = -1
"""UF or UT that is written ``F``: the number in force."""
COLUMNS: Final = 7
"""Number, first byte, kind, first byte and length of CONFIG (-1, 0 without), UF, UT."""
_POSE: Final = np.frombuffer(b"XYZWPR", np.uint8)
_OPEN_BRACKET, _CLOSE_BRACKET, _OPEN_BRACE, _CLOSE_BRACE = np.frombuffer(b"[]{}", np.uint8).astype(
    np.int64
)
_QUOTE, _COMMA, _COLON, _SEMICOLON, _EQUALS = np.frombuffer(b"',:;=", np.uint8).astype(np.int64)
_F, _G, _J, _P, _T, _U = np.frombuffer(b"FGJPTU", np.uint8).astype(np.int64)
_SMALL_D, _SMALL_E, _SMALL_G, _SMALL_M = np.frombuffer(b"degm", np.uint8).astype(np.int64)
"""Signs as numbers of one type: numba compiles a function again for each literal."""


@compile_kernel(PLAIN)
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
        k = _sign(buf, _sign(buf, k, end, _CLOSE_BRACE), end, _SEMICOLON)
        if k < 0:
            break
        rows += 1
        at = k
    return rows, at


@compile_kernel(PLAIN)
def _head(buf: Bytes, k: int, end: int, row: IntArray) -> int:
    """Reads ``P[n:"name"]{ GP1:`` and returns what follows, -1 if it does not stand there."""
    k = _sign(buf, k, end, _P)
    place = k - 1
    number, k = _whole(buf, _sign(buf, k, end, _OPEN_BRACKET), end, 6)
    k = _blank(buf, k, end)
    if 0 <= k < end and buf[k] == _COLON:
        while k < end and buf[k] != _CLOSE_BRACKET and buf[k] != 10 and buf[k] != 13:
            k += 1
    k = _sign(buf, _sign(buf, k, end, _CLOSE_BRACKET), end, _OPEN_BRACE)
    k = _next(buf, _sign(buf, k, end, _G), end, _P)
    group, k = _whole(buf, k, end, 2)
    row[0], row[1] = number, place
    return _sign(buf, k, end, _COLON) if group == 1 else -1


@compile_kernel(PLAIN)
def _frames(buf: Bytes, k: int, end: int, row: IntArray) -> int:
    """Reads ``UF : 1, UT : 1,`` and CONFIG if it is there."""
    for column, letter in ((5, _F), (6, _T)):
        k = _next(buf, _sign(buf, k, end, _U), end, letter)
        k = _blank(buf, _sign(buf, k, end, _COLON), end)
        if 0 <= k < end and buf[k] == _F:
            row[column], k = CURRENT, k + 1
        else:
            row[column], k = _whole(buf, k, end, 9)
        k = _sign(buf, k, end, _COMMA)
    row[3], row[4] = -1, 0
    j = k
    for c in b"CONFIG":
        j = _next(buf, _blank(buf, j, end) if c == 67 else j, end, np.int64(c))
    if j < 0:
        return k
    j = _sign(buf, _sign(buf, j, end, _COLON), end, _QUOTE)
    start = j
    while 0 <= j < end and buf[j] != _QUOTE and buf[j] != 10 and buf[j] != 13:
        j += 1
    row[3], row[4] = start, j - start
    return _sign(buf, _next(buf, j, end, _QUOTE), end, _COMMA)


@compile_kernel(PLAIN)
def _numbers(buf: Bytes, k: int, end: int, row: IntArray, spans: IntArray, value: Array) -> int:
    """Reads X Y Z W P R or J1 to J6 with their units."""
    k = _blank(buf, k, end)
    axes = 0 <= k < end and buf[k] == _J
    row[2] = 1 if axes else 0
    for i in range(6):
        if i > 0:
            k = _sign(buf, k, end, _COMMA)
        k = _blank(buf, k, end)
        if axes:
            k = _next(buf, _next(buf, k, end, _J), end, np.int64(49 + i))
        else:
            k = _next(buf, k, end, np.int64(_POSE[i]))
        k = _blank(buf, _sign(buf, k, end, _EQUALS), end)
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
            k = _next(buf, _next(buf, _next(buf, k, end, _SMALL_D), end, _SMALL_E), end, _SMALL_G)
        else:
            k = _next(buf, _next(buf, k, end, _SMALL_M), end, _SMALL_M)
    return k


@compile_kernel(PLAIN)
def _blank(buf: Bytes, k: int, end: int) -> int:
    while 0 <= k < end and (buf[k] == 32 or 9 <= buf[k] <= 13):
        k += 1
    return k


@compile_kernel(PLAIN)
def _next(buf: Bytes, k: int, end: int, sign: np.int64) -> int:
    """Returns what follows a sign that stands at ``k``, -1 if it does not."""
    return k + 1 if 0 <= k < end and buf[k] == sign else -1


@compile_kernel(PLAIN)
def _sign(buf: Bytes, k: int, end: int, sign: np.int64) -> int:
    """As :func:`_next`, blanks before the sign allowed."""
    return _next(buf, _blank(buf, k, end), end, sign)


@compile_kernel(PLAIN)
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
