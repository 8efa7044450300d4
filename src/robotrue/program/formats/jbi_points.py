"""Runs of plain JBI point lines ``C00000=x,y,z,rx,ry,rz``, read by a compiled loop."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.program.formats.krl_tokens import blank, read_number


@compile_kernel(PLAIN)
def point_lines(
    buf: Bytes,
    at: int,
    line: int,
    header: int,
    offset: int,
    table: IntArray,
    spans: IntArray,
    value: Array,
) -> tuple[int, int]:
    """Fills rows from the point lines that begin at ``at``, up to a line that is no such line.

    Args:
        buf: The bytes of the job.
        at: First byte of a line.
        line: One-based number of the line before it.
        header: What to write in the column of headers.
        offset: Added to the numbers of P points.
        table: (m, 4) gets number, line, header and the count of values of each point.
        spans: (m, 6, 2) gets first and last byte of the values.
        value: (m, 6) gets the values.

    Returns:
        How many rows were filled, and the first byte of the line after them.
    """
    rows = 0
    while rows < len(table):
        name, end = _name(buf, at, offset)
        if name < 0:
            break
        end = _values(buf, end, spans[rows], value[rows])
        if end < 0:
            break
        table[rows, 0], table[rows, 1] = name, line + rows + 1
        table[rows, 2], table[rows, 3] = header, 6
        rows += 1
        at = end
    return rows, at


@compile_kernel(PLAIN)
def _name(buf: Bytes, at: int, offset: int) -> tuple[int, int]:
    """Returns the number of the point named at ``at``, -1 if there is none, and what follows."""
    n = buf.size
    at = blank(buf, at, n)
    if at >= n or (buf[at] != 67 and buf[at] != 80):
        return -1, at
    number, k = 0, at + 1
    while k < n and 48 <= buf[k] <= 57 and k - at <= 6:
        number = 10 * number + buf[k] - 48
        k += 1
    first = k
    k = blank(buf, k, n)
    if first == at + 1 or k >= n or buf[k] != 61:
        return -1, at
    return number + (offset if buf[at] == 80 else 0), k + 1


@compile_kernel(PLAIN)
def _values(buf: Bytes, k: int, spans: IntArray, value: Array) -> int:
    """Reads six numbers and the end of the line; returns the next line, -1 if they are not six."""
    n = buf.size
    for i in range(6):
        k = blank(buf, k, n)
        number, end = read_number(buf, k, n)
        if end == k or not np.isfinite(number):
            return -1
        for j in range(k, end):
            if buf[j] == 32 or buf[j] == 9:  # KRL has blanks before an exponent, JBI has not
                return -1
        spans[i, 0], spans[i, 1], value[i] = k, end, number
        k = blank(buf, end, n)
        if i < 5:
            if k >= n or buf[k] != 44:
                return -1
            k += 1
    if k < n and buf[k] == 13:
        return k + 2 if k + 1 < n and buf[k + 1] == 10 else k + 1
    if k < n and buf[k] != 10:
        return -1
    return min(k + 1, n)
