"""Compiled reading of lines that are nothing but a point: ``GOTO/`` with numbers, rows of cells."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.program.formats.krl_tokens import blank


@compile_kernel(PLAIN)
def plain_gotos(
    buf: Bytes, first: IntArray, last: IntArray, start: IntArray, length: IntArray
) -> IntArray:
    """Returns the numbers (l,) of every line that is ``GOTO/`` with 3 or 6 of them; 0 for others.

    A line that continues another one, or is continued, is none.

    Args:
        buf: The bytes.
        first: (l,) first byte of each line.
        last: (l,) end of it, line end included.
        start: (l, 6) first byte of each number, written.
        length: (l, 6) written.
    """
    out = np.zeros(len(first), np.int64)
    continued = False
    for row in range(len(first)):
        i, end = first[row], last[row]
        while end > i and buf[end - 1] <= 32:
            end -= 1
        joined, continued = continued, end > i and buf[end - 1] == 36
        i = blank(buf, i, end)
        if joined or continued or i + 5 >= end:
            continue
        word = (buf[i] & 223, buf[i + 1] & 223, buf[i + 2] & 223, buf[i + 3] & 223)
        i = blank(buf, i + 4, end)
        if word != (71, 79, 84, 79) or i >= end or buf[i] != 47:
            continue
        i, count = i + 1, 0
        while count < 6:
            i = blank(buf, i, end)
            stop = _number_end(buf, i, end)
            if stop == i:
                break
            start[row, count], length[row, count] = i, stop - i
            count += 1
            i = blank(buf, stop, end)
            if i == end or buf[i] != 44:
                break
            i += 1
        else:
            continue
        if i == end and (count == 3 or count == 6):
            out[row] = count
    return out


@compile_kernel(PLAIN)
def blank_lines(buf: Bytes, first: IntArray, last: IntArray) -> None:
    """Puts blanks in lines (l,), line ends apart, in place."""
    for row in range(len(first)):
        for i in range(first[row], last[row]):
            if buf[i] != 10 and buf[i] != 13:
                buf[i] = 32


@compile_kernel(PLAIN)
def cell_spans(
    buf: Bytes,
    first: IntArray,
    last: IntArray,
    mark: int,
    columns: IntArray,
    begin: IntArray,
    end: IntArray,
) -> None:
    """Writes where the cells (n, k) of columns (k,) stand in rows, without blanks and quotes.

    Args:
        buf: The bytes.
        first: (n,) first byte of each row.
        last: (n,) end of it, line end included or not.
        mark: Byte between cells.
        columns: (k,) column of each cell wanted.
        begin: (n, k) written.
        end: (n, k) written.
    """
    for row in range(len(first)):
        i, column, quoted, at = first[row], 0, False, first[row]
        stop = last[row]
        while stop > i and (buf[stop - 1] == 10 or buf[stop - 1] == 13):
            stop -= 1
        while i <= stop:
            if i == stop or (buf[i] == mark and not quoted):
                for k in range(len(columns)):
                    if columns[k] == column:
                        b, e = at, i
                        while b < e and (buf[b] <= 32 or buf[b] == 34):
                            b += 1
                        while e > b and (buf[e - 1] <= 32 or buf[e - 1] == 34):
                            e -= 1
                        begin[row, k], end[row, k] = b, e
                column, at = column + 1, i + 1
            elif buf[i] == 34:
                quoted = not quoted
            i += 1


@compile_kernel(PLAIN)
def _number_end(buf: Bytes, i: int, end: int) -> int:
    """Returns the end of a number without exponent of at most fifteen digits, ``i`` for none."""
    at, digits, point = i, 0, False
    if i < end and (buf[i] == 43 or buf[i] == 45):
        i += 1
    while i < end and (48 <= buf[i] <= 57 or (buf[i] == 46 and not point)):
        point |= buf[i] == 46
        digits += buf[i] != 46
        i += 1
    return i if 0 < digits <= 15 else at
