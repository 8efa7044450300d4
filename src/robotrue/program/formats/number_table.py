"""The numbers of all targets of a program as one table: where each stands and what it says."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.number_kernels import literal_numbers, plain_tokens, respell
from robotrue.program.formats.number_text import restyle

_QUICK: Final = 1e8
"""Values below this are printed by the compiled way."""
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
        data: The bytes the literals stand in.
        layouts: For each kind of literal the column each of its numbers goes to.
        comment: Sign behind which the rest of a line is no number.
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

    def numbers(self) -> Numbers:
        """Returns the whole table."""
        width = 1 + max(max(layout) for layout in self._layouts)
        columns = np.full((len(self._layouts), width), -1)
        for kind, layout in enumerate(self._layouts):
            columns[kind, : len(layout)] = layout
        shape = (len(self._first), width)
        start, length = np.full(shape, -1), np.zeros(shape, np.int64)
        value = np.full(shape, np.nan)
        first, last, kinds = (
            np.array(each, np.int64) for each in (self._first, self._last, self._kind)
        )
        text = np.frombuffer(self._data, np.uint8)
        literal_numbers(text, first, last, kinds, columns, self._comment[0], start, length, value)
        for row, column in np.argwhere((start >= 0) & np.isnan(value)).tolist():
            at = int(start[row, column])
            value[row, column] = float(self._data[at : at + int(length[row, column])])
        value[~np.isfinite(value)] = np.nan
        return Numbers(start=start, length=length, value=value)


def respell_tokens(
    data: bytes,
    numbers: Numbers,
    values: Array,
    touched: BoolArray,
    enough: IntArray,
    least: IntArray,
    *,
    aligned: bool = False,
) -> bytes:
    """Returns the bytes with the touched numbers rewritten in their own style.

    Args:
        data: The bytes.
        numbers: Where the numbers stand.
        values: (n, w) in the unit they are printed in.
        touched: (n, w) those to rewrite; a number that says its value already stays.
        enough: (n, w) decimals that can hold a correction.
        least: (n, w) decimals to print where a number has fewer than that.
        aligned: A number after two or more blanks keeps its column where they allow it.
    """
    where = np.nonzero(touched & (numbers.start >= 0))
    order = np.argsort(numbers.start[where], kind="stable")
    start, length, limit, more = (
        column[where][order] for column in (numbers.start, numbers.length, enough, least)
    )
    old, value = numbers.value[where][order], values[where][order]
    if not len(start):
        return data
    text = np.frombuffer(data, np.uint8)
    odd = ~plain_tokens(text, start, length) | (np.abs(value) >= _QUICK)
    slow, texts = np.zeros(len(start) + 1, np.int64), b""
    if odd.any():
        slow, texts = _restyle_odd(data, np.flatnonzero(odd), start, length, value, limit, more)
    out = np.empty(len(data) + _WIDEST * len(start) + len(texts), np.uint8)
    size = respell(
        text, start, length, old, value, limit, more, slow, np.frombuffer(texts, np.uint8),
        aligned, out,
    )  # fmt: skip
    return out[:size].tobytes()


def _restyle_odd(
    data: bytes,
    odd: IntArray,
    start: IntArray,
    length: IntArray,
    value: Array,
    enough: IntArray,
    least: IntArray,
) -> tuple[IntArray, bytes]:
    """Returns the texts of the odd tokens in one piece, and where each begins (t + 1,)."""
    size = np.zeros(len(start) + 1, np.int64)
    texts = []
    for t in odd.tolist():
        token = data[start[t] : start[t] + length[t]]
        shown = len(token.partition(b".")[2])
        text = restyle(token, float(value[t]), least=0 if shown >= enough[t] else int(least[t]))
        texts.append(text)
        size[t + 1] = len(text)
    return np.cumsum(size), b"".join(texts)
