"""Texts that are alike but for their numbers, as records and moves are, in one compiled pass.

A pattern of the language reads one text. Those right after it are alike if they have the same
bytes, apart from the numbers in some of its groups and the width of blanks.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Sequence
from itertools import filterfalse
from typing import Final

import numpy as np

from robotrue.core.arrays import Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.program.program import Motion

_PLACE, _WHOLE, _ZONE = 0, 1, 2
"""Kinds of groups: copied byte for byte, one whole number, or any text with numbers."""
_DIGITS: Final = 6
"""Of a whole number; a longer one is left to the pattern."""
_LONGEST: Final = 15
"""Digits before the point of a number, and after it."""
_ROWS: Final = 4096
_MOST_PASSED: Final = 64
"""Texts that are left to the pattern after several with none alike after them."""


class Alike:
    """Finds texts that are alike.

    Args:
        data: The bytes.
        wholes: Groups of the pattern that are one whole number each.
        zones: Groups whose numbers have a sign, digits and a point.
        places: Further groups whose places are wanted. No two groups overlap.
    """

    def __init__(
        self, data: bytes, wholes: Sequence[int], zones: Sequence[int], places: Sequence[int] = ()
    ) -> None:
        self._text = np.frombuffer(data, np.uint8)
        self._groups = (0, *wholes, *zones, *places)
        kinds = [_PLACE] + [_WHOLE] * len(wholes) + [_ZONE] * len(zones) + [_PLACE] * len(places)
        self._kinds = np.array(kinds, np.int64)
        self._rows = np.empty((_ROWS, 2 * len(kinds)), np.int64)
        self._pause = self._passed = 0

    def after(self, match: re.Match[bytes], end: int) -> Iterator[IntArray]:
        """Yields the texts after one that the pattern found, in columns (k, 2 + 2 g).

        First byte and end of the text come first, then for each group, in the order given, the
        same; of a whole number its value and its first byte.
        """
        if self._passed < self._pause:
            self._passed += 1
            return
        spans, count, at = np.array([match.span(each) for each in self._groups]), _ROWS, match.end()
        order = np.argsort(spans[1:, 0], kind="stable") + 1
        while count == _ROWS:
            count = _find_alike(self._text, at, end, spans, self._kinds, order, self._rows)
            if count:
                at = int(self._rows[count - 1, 1])
                yield self._rows[:count].copy()
        self._passed = 0
        self._pause = 0 if at > match.end() else min(2 * self._pause + 1, _MOST_PASSED)


def note_moves(
    path: array[int], motion: dict[int, Motion], places: IntArray, rows: list[int], how: Motion
) -> None:
    """Notes moves of one kind in the path of a program, and how each row is moved to.

    Args:
        path: As ``Program.path``, row by row.
        motion: As the first move to a row is, PTP if any is.
        places: (k,) of the moves.
        rows: Where they go.
        how: All of them.
    """
    path.frombytes(np.stack([places, rows, np.full(len(rows), how)], axis=1).tobytes())
    fresh = rows if how == Motion.PTP else filterfalse(motion.__contains__, rows)
    motion.update(dict.fromkeys(fresh, how))


@compile_kernel(PLAIN)
def _find_alike(
    buf: Bytes, at: int, end: int, spans: IntArray, kinds: IntArray, order: IntArray, rows: IntArray
) -> int:
    """Writes the rows of texts from a byte on, as many as there is room; returns their number.

    Args:
        buf: The file.
        at: First byte.
        end: Byte after the last.
        spans: (1 + g, 2) begin and end of the model and of its groups; -1 where it has none.
        kinds: (1 + g,) of the groups.
        order: (g,) groups by their begin.
        rows: (k, 2 + 2 g) as :meth:`Alike.after` yields them.
    """
    for found in range(len(rows)):
        row = rows[found]
        row[0] = at
        at = _compare(buf, at, end, spans, kinds, order, row)
        if at < 0:
            return found
        row[1] = at
    return len(rows)


@compile_kernel(PLAIN)
def _compare(
    buf: Bytes, q: int, end: int, spans: IntArray, kinds: IntArray, order: IntArray, row: IntArray
) -> int:
    """Writes the row of one text and returns its end; -1 if it is not alike."""
    p, last = spans[0]
    k = group = 0
    while True:
        if group > 0 and p == spans[group, 1]:
            row[2 * group + 1], group = q, 0
        while k < order.size and spans[order[k], 0] < 0:
            row[2 * order[k]] = row[2 * order[k] + 1] = -1
            k += 1
        if group == 0 and k < order.size and p == spans[order[k], 0]:
            group, k = order[k], k + 1
            row[2 * group] = q
            if kinds[group] == _WHOLE:
                first, value = q, 0
                while q < end and 48 <= buf[q] <= 57 and q - first <= _DIGITS:
                    value, q = 10 * value + buf[q] - 48, q + 1
                if not 1 <= q - first <= _DIGITS:
                    return -1
                row[2 * group], row[2 * group + 1] = value, first
                p, group = spans[group, 1], 0
                continue
        elif p >= last:
            # a line end is not split
            return -1 if buf[last - 1] == 13 and q < end and buf[q] == 10 else q
        zone = group > 0 and kinds[group] == _ZONE
        mark = spans[group, 1] if group > 0 else spans[order[k], 0] if k < order.size else last
        while p < mark:
            c = buf[p]
            if q >= end:
                return -1
            if c == 32 or c == 9:
                if buf[q] != 32 and buf[q] != 9:
                    return -1
                p, q = _pass_blanks(buf, p, mark), _pass_blanks(buf, q, end)
            elif zone and 43 <= c <= 57 and c != 44 and c != 47:
                p, q = _pass_number(buf, p, mark), _pass_number(buf, q, end)
                if p < 0 or q < 0 or (p < last and buf[p] | 32 == 101):
                    return -1
            elif buf[q] == c:
                p, q = p + 1, q + 1
            else:
                return -1


@compile_kernel(PLAIN)
def _pass_blanks(buf: Bytes, at: int, end: int) -> int:
    """Returns the first byte that is no blank."""
    while at < end and (buf[at] == 32 or buf[at] == 9):
        at += 1
    return at


@compile_kernel(PLAIN)
def _pass_number(buf: Bytes, at: int, end: int) -> int:
    """Returns the byte after a number; -1 if there is none, or one with an exponent or too long."""
    at += at < end and (buf[at] == 43 or buf[at] == 45)
    first = at
    while at < end and 48 <= buf[at] <= 57:
        at += 1
    whole, digits = at - first, 0
    if at < end and buf[at] == 46:
        first = at = at + 1
        while at < end and 48 <= buf[at] <= 57:
            at += 1
        digits = at - first
    return at if 1 <= whole + digits and max(whole, digits) <= _LONGEST else -1
