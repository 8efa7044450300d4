"""Compiled passes over the words of a path: cells of rows, decimals of tokens, owed words."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel


@compile_kernel(PLAIN)
def find_cell_numbers(
    buf: Bytes, begin: IntArray, mark: int, column: IntArray, start: IntArray, length: IntArray
) -> None:
    """Writes the places of the numbers of rows of cells; -1 where one is not plainly written.

    Args:
        buf: The table.
        begin: (n,) first byte of each row; each has a number in the cells that are wanted.
        mark: Between cells; in a cell that begins with a quotation mark only after the other.
        column: (c,) where the number of each cell goes, -1 where it is not wanted.
        start: (n, w) first byte, -1 before.
        length: (n, w) bytes, without blanks and quotation marks.
    """
    for row in range(begin.size):
        i = begin[row]
        for cell in range(column.size):
            first, quoted = i, i < buf.size and buf[i] == 34
            while i < buf.size and buf[i] != 10 and buf[i] != 13 and (quoted or buf[i] != mark):
                if quoted and i > first and buf[i] == 34:
                    quoted = i + 1 < buf.size and buf[i + 1] == 34  # two are one of the text
                    i += quoted
                i += 1
            last, place = i, column[cell]
            i += 1
            if place < 0:
                continue
            while first < last and (buf[first] == 32 or buf[first] == 9 or buf[first] == 34):
                first += 1
            while last > first and (
                buf[last - 1] == 32 or buf[last - 1] == 9 or buf[last - 1] == 34
            ):
                last -= 1
            plain = first < last
            for k in range(first, last):
                c = buf[k]
                plain &= 48 <= c <= 57 or c == 43 or c == 45 or c == 46 or (c | 32) == 101
            if plain:
                start[row, place], length[row, place] = first, last - first


@compile_kernel(PLAIN)
def decimals_of(buf: Bytes, start: IntArray, length: IntArray) -> IntArray:
    """Returns the decimals of tokens (n, w), 15 at most; 0 for one without a point, or none."""
    out = np.zeros(start.shape, np.int64)
    for i in range(start.shape[0]):
        for k in range(start.shape[1]):
            if start[i, k] < 0:
                continue
            end = start[i, k] + length[i, k]
            for j in range(start[i, k], end):
                if buf[j] == 46:
                    out[i, k] = min(end - j - 1, 15)
                elif (buf[j] | 32) == 101:
                    out[i, k] = 15
    return out


@compile_kernel(PLAIN)
def with_point(buf: Bytes, start: IntArray, length: IntArray) -> BoolArray:
    """Returns which tokens (t,) have a decimal point."""
    out = np.zeros(len(start), np.bool_)
    for t in range(len(start)):
        for j in range(start[t], start[t] + length[t]):
            out[t] |= buf[j] == 46
    return out


@compile_kernel(PLAIN)
def owed_words(
    written: BoolArray, said: Array, wanted: Array, kept: Array, decimals: IntArray, turn: IntArray,
    skip: BoolArray, able: BoolArray, barred: BoolArray, owed: BoolArray, donor: IntArray,
) -> None:  # fmt: skip
    """Marks the words (n, 6) that have to be inserted, and the row whose style each takes.

    A left-out word is owed when the inherited value differs from the new one by more than half of
    its last digit; of a word that no row has, of the digits it would get. Of a tool axis that is
    left out whole, all three are owed or none.

    Args:
        written: (n, 6) the row has the word.
        said: (n, 6) its value when it is written.
        wanted: (n, 6) new values of the row, NaN where not known.
        kept: (n, 6) what is inherited when nothing moves.
        decimals: (n, 6) of written words, and of those that would be inserted.
        turn: (n,) way of telling the orientation.
        skip: (n,) nothing is inherited from the row.
        able: (n,) words can be inserted.
        barred: (n, 6) but not these.
        owed: (n, 6) written here.
        donor: (n, 6) written here, -1 without one.
    """
    state, digits = np.full(6, np.nan), np.full(6, -1, np.int64)
    last, mode = np.full(6, -1, np.int64), -1
    for i in range(len(turn)):
        if skip[i] or not able[i]:
            continue
        if turn[i] != mode:
            for c in range(3, 6):
                state[c], digits[c], last[c] = np.nan, -1, -1
            mode = turn[i]
        vector = turn[i] == 2
        some = written[i, 3] or written[i, 4] or written[i, 5]
        for c in range(6):
            donor[i, c] = last[c]
            if written[i, c]:
                state[c], digits[c], last[c] = said[i, c], decimals[i, c], i
                continue
            if c > 2 and turn[i] == 0:
                continue
            if vector and c > 2 and some:
                state[c] = 0.0
            if barred[i, c] or np.isnan(wanted[i, c]):
                continue
            have = kept[i, c] if np.isnan(state[c]) else state[c]
            scale = 10.0 ** (digits[c] if digits[c] >= 0 else decimals[i, c])
            owed[i, c] = abs(wanted[i, c] - have) > 0.5 / scale
            if owed[i, c]:
                state[c] = np.round(wanted[i, c] * scale) / scale
        if vector and not some and (owed[i, 3] or owed[i, 4] or owed[i, 5]):
            for c in range(3, 6):
                owed[i, c] = True
                state[c] = wanted[i, c]
