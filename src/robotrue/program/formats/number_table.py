"""The numbers of all targets of a program as one table: their places and values."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.number_kernels import (
    literal_numbers,
    pick_tokens,
    respell,
    token_values,
)
from robotrue.program.formats.number_text import Stretch, restyle, splice_texts

_WIDEST: Final = 28
"""Bytes one rewritten number can take: sign, nine digits, point, fifteen decimals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """Tokens of n targets with up to w numbers each.

    Attributes:
        start: (n, w) first byte, -1 where a target has no such number.
        length: (n, w) bytes.
        value: (n, w) as printed, NaN where there is none or it is beyond any number.
    """

    start: IntArray
    length: IntArray
    value: Array

    def rows(self, index: IntArray) -> Numbers:
        """Returns the tokens of chosen rows; -1 chooses a row without any."""
        if len(index) == len(self.start) and (index == np.arange(len(index))).all():
            return self
        none = np.asarray(index < 0)[:, None]
        if not none.any():
            start, length, value = self.start[index], self.length[index], self.value[index]
            return Numbers(start=start, length=length, value=value)
        if not len(self.start):
            shape = (len(index), self.start.shape[1])
            return Numbers(
                start=np.full(shape, -1), length=np.zeros(shape, np.int64),
                value=np.full(shape, np.nan),
            )  # fmt: skip
        return Numbers(
            start=np.where(none, -1, self.start[index]),
            length=np.where(none, 0, self.length[index]),
            value=np.where(none, np.nan, self.value[index]),
        )


class NumberTable:
    """Collects literals, whose numbers are read in one compiled pass at the end.

    Args:
        data: The bytes that contain the literals.
        layouts: For each kind of literal the column each of its numbers goes to.
        comment: Sign after which the remainder of a line is no number.
    """

    def __init__(self, data: bytes, layouts: Sequence[Sequence[int]], comment: bytes) -> None:
        self._data, self._layouts, self._comment = data, layouts, comment
        self._first, self._last, self._kind = array("q"), array("q"), array("q")

    def add(self, start: int, end: int, kind: int) -> int:
        """Returns the row of a literal between two bytes, whose form has been checked."""
        self._first.append(start)
        self._last.append(end)
        self._kind.append(kind)
        return len(self._first) - 1

    def extend(self, edges: array[int], kind: int) -> range:
        """Returns the rows of literals of one kind, from their first bytes and ends in turn."""
        rows = range(len(self._first), len(self._first) + len(edges) // 2)
        self._first.extend(edges[::2])
        self._last.extend(edges[1::2])
        self._kind.extend([kind] * len(rows))
        return rows

    def numbers(self) -> Numbers:
        """Returns the whole table."""
        width = 1 + max(max(layout) for layout in self._layouts)
        columns = np.full((len(self._layouts), width), -1)
        for kind, layout in enumerate(self._layouts):
            columns[kind, : len(layout)] = layout
        shape = (len(self._first), width)
        start, length = np.full(shape, -1), np.zeros(shape, np.int64)
        first, last, kinds = (
            np.array(each, np.int64) for each in (self._first, self._last, self._kind)
        )
        text = np.frombuffer(self._data, np.uint8)
        literal_numbers(text, first, last, kinds, columns, self._comment[0], start, length)
        value = read_tokens(self._data, start, length)
        value[~np.isfinite(value)] = np.nan
        return Numbers(start=start, length=length, value=value)


def read_tokens(data: bytes, start: IntArray, length: IntArray) -> Array:
    """Returns the values of tokens (n, w) that are numbers; NaN where ``start`` is negative."""
    value = token_values(np.frombuffer(data, np.uint8), start, length)
    for row, column in np.argwhere((start >= 0) & np.isnan(value)).tolist():
        at = int(start[row, column])
        value[row, column] = float(data[at : at + int(length[row, column])])
    return value


def put_stretches(
    data: bytes, stretches: Sequence[Stretch], start: IntArray
) -> tuple[bytes, IntArray]:
    """Returns the bytes with stretches replaced, and where other bytes then are.

    Args:
        data: The bytes.
        stretches: In any order; those of one place keep theirs.
        start: Other bytes (any shape), clear of the stretches; -1 stays -1.
    """
    if not stretches:
        return data, start
    ordered = sorted(stretches, key=lambda each: each[:2])
    growth = np.cumsum([0, *(len(text) - size for _, size, text in ordered)])
    first = [place for place, _, _ in ordered]
    moved = start + growth[np.searchsorted(first, start, side="right")]
    return splice_texts(data, ordered), np.where(start < 0, start, moved)


def respell_in_style(token: bytes, value: float, least: int) -> bytes:
    """Returns a number in the style of another one."""
    return restyle(token, value, least=least)


def respell_tokens(
    data: bytes,
    numbers: Numbers,
    values: Array,
    touched: BoolArray,
    enough: IntArray,
    least: IntArray,
    *,
    aligned: bool = False,
    apart: bool = False,
    respell_odd: Callable[[bytes, float, int], bytes] = respell_in_style,
) -> bytes:
    """Returns the bytes with the touched numbers rewritten in their own style.

    Args:
        data: The bytes.
        numbers: Places of the numbers.
        values: (n, w) in the unit they are printed in.
        touched: (n, w) those to rewrite; a number that equals its value already stays.
        enough: (n, w) decimals that can hold a correction.
        least: (n, w) decimals to print where a number has fewer than that.
        aligned: A number after two or more blanks keeps its column where they allow it.
        apart: A number right after a name gets a blank where it would become a part of it.
        respell_odd: Returns what takes the place of a number that is not plain digits with a point,
            from its bytes, its new value and the decimals to print at least.
    """
    text, size = np.frombuffer(data, np.uint8), touched.size
    picked, joined = np.empty((2, size), np.int64), np.empty(size, np.bool_)
    start, length = (np.ascontiguousarray(each) for each in (numbers.start, numbers.length))
    limit, more = (np.ascontiguousarray(each) for each in (enough, least))
    old, value = (np.ascontiguousarray(each) for each in (numbers.value, values))
    count, rising = pick_tokens(text, start, length, touched, value, picked[0], picked[1], joined)
    if not count:
        return data
    start, length, limit, more = (each.ravel() for each in (start, length, limit, more))
    old, value = (each.ravel() for each in (old, value))
    index, odd = picked[:, :count]
    joined = joined[:count] & apart
    if not rising:
        order = np.argsort(start[index], kind="stable")
        index, odd, joined = index[order], odd[order], joined[order]
    slow, texts = np.zeros(count + 1, np.int64), b""
    if odd.any() or joined.any():
        spelled = []
        for t in np.flatnonzero((odd != 0) | joined).tolist():
            i = int(index[t])
            token = data[start[i] : start[i] + length[i]]
            fine = len(token.partition(b".")[2]) >= limit[i]
            new = respell_odd(token, float(value[i]), 0 if fine else int(more[i]))
            spelled.append(b" " + new if joined[t] and new[:1].isdigit() else new)
            slow[t + 1] = len(spelled[-1])
        slow, texts = np.cumsum(slow), b"".join(spelled)
    out = np.empty(len(data) + _WIDEST * count + len(texts), np.uint8)
    end = respell(
        text, index, start, length, old, value, limit, more, slow,
        np.frombuffer(texts, np.uint8), aligned, out,
    )  # fmt: skip
    return out[:end].tobytes()
