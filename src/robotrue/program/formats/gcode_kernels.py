"""Compiled reading of plain blocks of G-code: addresses, each with a number, nothing else."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Bytes, Integers
from robotrue.core.compiled import PLAIN as AS_WRITTEN
from robotrue.core.compiled import compile_kernel

EMPTY: Final = 0
PLAIN: Final = 1
ODD: Final = 2
"""A block with something else in it: a keyword, an expression, a code that does more."""
NO_STATE: Final = -2
"""A block that does not set a group."""
CODES: Final = 10000
"""Codes are tenths: G43.4 is 434."""
SIDEWAYS: Final = 6
"""Of the groups, that of the radius of the tool."""
INDICES: Final = 14
"""Second index of an address: 0 for none, 1 + digit (A3=), 11 to 13 for X, Y, Z after it (NX)."""


@compile_kernel(AS_WRITTEN)
def count_letters(buf: Bytes) -> int:
    """Returns the letters of a file: no file has more words."""
    count = 0
    for c in buf:
        count += 65 <= (c & 223) <= 90
    return count


@compile_kernel(AS_WRITTEN)
def read_blocks(
    buf: Bytes,
    first: Integers,
    last: Integers,
    column: Integers,
    group: Integers,
    setting: Integers,
    signs: Integers,
    status: Integers,
    code_end: Integers,
    state: Integers,
    block: Integers,
    where: Integers,
    start: Integers,
    length: Integers,
    value: Array,
) -> int:
    """Reads all blocks; returns the number of words found.

    Args:
        buf: The bytes.
        first: (l,) first byte of each block.
        last: (l,) end of it, line end included or not.
        column: (26, INDICES) column of each address, -1 for one that makes a block odd, -2 for one
            that is ignored.
        group: (2, CODES) group that a G or M code sets, -1 odd, -2 ignored.
        setting: (2, CODES) what it sets it to.
        signs: (4,) bytes that end a block, that open and close a comment (0: none), and 1 if a
            block may begin with a bare number and ``L`` or ``LN`` (conversational programs).
        status: (l,) written: ``EMPTY``, ``PLAIN`` or ``ODD``.
        code_end: (l,) written: end of the block without its comment.
        state: (l, groups) written where a code sets a group.
        block: (t,) written: block of each word.
        where: (t,) its column.
        start: (t,) first byte of its number.
        length: (t,) bytes of it.
        value: (t,) NaN where fifteen digits do not hold it.
    """
    count = 0
    for row in range(len(first)):
        i, end, begun = first[row], last[row], count
        odd, words = False, 0
        code_end[row] = end
        if signs[3]:
            while i < end and (buf[i] == 32 or buf[i] == 9 or 48 <= buf[i] <= 57):
                i += 1
            if i + 1 < end and buf[i] == 76 and (buf[i + 1] == 32 or buf[i + 1] == 78):
                i += 1 + (buf[i + 1] == 78)
                state[row, 0] = 1
                words = 1
        while i < end:
            c = buf[i]
            if c == 32 or c == 9 or c == 10 or c == 13:
                i += 1
                continue
            if c == signs[0]:
                code_end[row] = i
                break
            if signs[1] and c == signs[1]:
                j = i
                while j < end and buf[j] != signs[2]:
                    j += 1
                if j == end:
                    odd = True
                    break
                i = j + 1
                continue
            c &= 223
            words += 1
            if not 65 <= c <= 90 or odd:
                odd = True
                i += 1
                continue
            letter, index, equal = c - 65, 0, False
            i += 1
            if signs[3] and i < end and 88 <= buf[i] <= 90 and (c == 78 or c == 84):
                index = 11 + buf[i] - 88
                i += 1
            elif signs[3] and c == 70 and i < end and 65 <= buf[i] <= 90:  # FMAX, FAUTO
                while i < end and 65 <= buf[i] <= 90:
                    i += 1
                continue
            elif i + 1 < end and 48 <= buf[i] <= 57 and buf[i + 1] == 61:
                index = 1 + buf[i] - 48
                i += 1
            while i < end and (buf[i] == 32 or buf[i] == 9):
                i += 1
            if i < end and buf[i] == 61:
                equal = True
                i += 1
                while i < end and (buf[i] == 32 or buf[i] == 9):
                    i += 1
            at = i
            if i < end and (buf[i] == 43 or buf[i] == 45):
                i += 1
            whole, digits, decimals, point = 0, 0, 0, False
            while i < end and (48 <= buf[i] <= 57 or (buf[i] == 46 and not point)):
                if buf[i] == 46:
                    point = True
                else:
                    digits += 1
                    decimals += point
                    if digits <= 15:
                        whole = 10 * whole + (buf[i] - 48)
                i += 1
            if digits == 0 or (i < end and _goes_on(buf, i, end, equal)):
                odd = True
                continue
            number = np.nan if digits > 15 else whole / 10.0**decimals
            if buf[at] == 45:
                number = -number
            if index == 0 and (c == 71 or c == 77) and not equal:
                code = int(np.rint(10.0 * number)) if 0.0 <= number < 0.1 * CODES else -1
                which = 0 if c == 71 else 1
                kind = group[which, code] if code >= 0 else -1
                if kind >= 0:
                    state[row, kind] = setting[which, code]
                odd |= kind == -1
                continue
            if signs[3] and c == 82 and number == 0.0:  # R0: no radius of the tool
                state[row, SIDEWAYS] = 0
            goes_to = column[letter, index]
            odd |= goes_to == -1
            if goes_to < 0:
                continue
            for k in range(begun, count):
                odd |= where[k] == goes_to
            block[count], where[count] = row, goes_to
            start[count], length[count], value[count] = at, i - at, number
            count += 1
        status[row] = ODD if odd else PLAIN if words else EMPTY
        if odd:
            count = begun
            for k in range(state.shape[1]):
                state[row, k] = NO_STATE
    return count


@compile_kernel(AS_WRITTEN)
def _goes_on(buf: Bytes, i: int, end: int, equal: bool) -> bool:
    """Returns whether what follows a number makes it part of something larger."""
    while i < end and (buf[i] == 32 or buf[i] == 9):
        i += 1
    if i >= end:
        return False
    c = buf[i]
    if c == 46 or c == 61 or c == 95 or c == 36 or c == 35 or c == 91 or (c == 40 and equal):
        return True
    if c == 42 or c == 43 or c == 45 or c == 47 or 48 <= c <= 57:
        return True
    # 1.5EX3 and 1E3 are numbers of other forms.
    return equal and (c & 223) == 69 and i + 1 < end and buf[i + 1] != 61
