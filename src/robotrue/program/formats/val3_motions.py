"""Runs of VAL3 motions to the elements of an array in turn, one in a line."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel

_WORD: Final = rb"[A-Za-z_]\w*+(?:\[\d++\])?+"
_MOVE: Final = re.compile(
    rb"^[ \t]*+(move[jl]\()([A-Za-z_]\w*+)\[(\d{1,9}+)(\]," + _WORD + b"," + _WORD
    + rb"\))[ \t]*+\r?$",
    re.MULTILINE,
)  # fmt: skip
_MOST_DIGITS: Final = 9
_OTHER, _TAG_LINE, _MOTION, _FOLLOWS = 0, 1, 2, 3
"""Kinds of lines of code: other text; a tag without brackets; a motion with a number in brackets;
one that is the line before but for a number that is one larger."""


class MoveRun(NamedTuple):
    """Plain motions in lines one after the other, to elements in turn.

    Attributes:
        line: Zero-based, of the first.
        key: Number of its element.
        length: How many there are.
        text: Before the name, name, and after the number.
    """

    line: int
    key: int
    length: int
    text: tuple[bytes, bytes, bytes]

    def show(self, keys: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """Yields line and text of the motions to some elements, given in rising order."""
        first, last = bisect_left(keys, self.key), bisect_left(keys, self.key + self.length)
        how, name, rest = self.text
        for key in keys[first:last]:
            yield self.line + key - self.key, b"%b%b[%d%b" % (how, name, key, rest)


def find_runs(data: bytes, edges: IntArray, line: int) -> tuple[list[MoveRun], bytes]:
    """Returns the runs of plain motions in a window of code, and the text of the other lines.

    Args:
        data: The window.
        edges: (l + 1,) first byte of each of its lines, and the size.
        line: Zero-based line of the file that it begins in.
    """
    kind, number = np.zeros((2, len(edges) - 1), np.int64)
    _sort_code(np.frombuffer(data, np.uint8), edges, kind, number)
    begins = np.flatnonzero(kind != _FOLLOWS).tolist()
    runs, others = [], []
    for row, after in pairwise([*(begins if len(edges) > 1 else ()), len(edges) - 1]):
        if kind[row] == _TAG_LINE:
            continue
        move = _MOVE.match(data, edges[row], edges[row + 1]) if kind[row] == _MOTION else None
        if move:
            how, name, key, rest = move.groups()
            runs.append(MoveRun(line + row, int(key), after - row, (how, name, rest)))
        else:
            others.append(data[edges[row] : edges[after]])
    return runs, b"".join(others)


@compile_kernel(PLAIN)
def _sort_code(buf: Bytes, edges: IntArray, kind: IntArray, number: IntArray) -> None:
    """Writes the kind of each line (l,), and the number in its first brackets, -1 without one.

    A line follows the motion before it if it is the same but for a number that is one larger.
    """
    was_left = was_right = 0
    for row in range(kind.size):
        start, end = edges[row], edges[row + 1]
        while start < end and (buf[start] == 32 or buf[start] == 9):
            start += 1
        left, plain = start, start < end and buf[start] == 60
        for i in range(start, end if plain else start):
            plain &= buf[i] != 40 and buf[i] != 41
        number[row], kind[row] = -1, _TAG_LINE if plain else _OTHER
        if end - start < 4 or buf[start] != 109 or buf[start + 1] != 111:
            continue
        while left < end and buf[left] != 91:
            left += 1
        right, value = left + 1, 0
        while right < end and 48 <= buf[right] <= 57 and right - left <= _MOST_DIGITS:
            value = 10 * value + buf[right] - 48
            right += 1
        if right == left + 1 or right >= end or buf[right] != 93:
            continue
        number[row], kind[row] = value, _MOTION
        before = edges[row - 1] if row else 0
        same = row > 0 and number[row - 1] == value - 1 and number[row - 1] >= 0
        same = same and left - edges[row] == was_left - before
        same = same and end - right == edges[row] - was_right
        for k in range(left - edges[row] if same else 0):
            same &= buf[edges[row] + k] == buf[before + k]
        for k in range(end - right if same else 0):
            same &= buf[right + k] == buf[was_right + k]
        if same:
            kind[row] = _FOLLOWS
        was_left, was_right = left, right
