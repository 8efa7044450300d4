"""The numbers of all targets of a program as one table: where each stands and what it says."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.number_kernels import plain_tokens, respell
from robotrue.program.formats.number_text import restyled

_HELD: Final = 4096
"""Matches kept as objects before they become rows of arrays."""
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
    """Collects matches whose groups are numbers.

    Args:
        width: Columns of the table.
        layouts: For each kind of literal the columns its groups go to; -1 before and after them
            are groups that are no numbers.
    """

    def __init__(self, width: int, layouts: Sequence[Sequence[int]]) -> None:
        self._width = width
        self._layouts = [np.array([each for each in layout if each >= 0]) for layout in layouts]
        self._before = [_leading(layout) for layout in layouts]
        self._held: list[tuple[int, re.Match[bytes]]] = []
        self._done: list[Numbers] = []
        self._rows = 0

    def add(self, match: re.Match[bytes], kind: int) -> int:
        """Returns the row a literal of this kind gets."""
        self._held.append((kind, match))
        if len(self._held) >= _HELD:
            self._flush()
        self._rows += 1
        return self._rows - 1

    def numbers(self) -> Numbers:
        """Returns the whole table."""
        self._flush()
        empty = np.empty((0, self._width), np.int64)
        return Numbers(
            start=np.concatenate([empty, *(part.start for part in self._done)]),
            length=np.concatenate([empty, *(part.length for part in self._done)]),
            value=np.concatenate([empty.astype(np.float64), *(part.value for part in self._done)]),
        )

    def _flush(self) -> None:
        shape = (len(self._held), self._width)
        start, length = np.full(shape, -1), np.zeros(shape, np.int64)
        value = np.full(shape, np.nan)
        kinds = np.array([kind for kind, _ in self._held], np.int64)
        for kind, columns in enumerate(self._layouts):
            rows = np.flatnonzero(kinds == kind)
            if not len(rows):
                continue
            found = [self._held[row][1] for row in rows.tolist()]
            first = self._before[kind]
            numbers = slice(first, first + len(columns))
            spans = np.array([match.regs for match in found])[:, 1:][:, numbers]
            at = np.ix_(rows, columns)
            start[at], length[at] = spans[:, :, 0], spans[:, :, 1] - spans[:, :, 0]
            value[at] = [[float(token) for token in match.groups()[numbers]] for match in found]
        value[~np.isfinite(value)] = np.nan
        self._done.append(Numbers(start=start, length=length, value=value))
        self._held = []


def _leading(layout: Sequence[int]) -> int:
    """Returns how many groups stand before the first number."""
    return next((i for i, each in enumerate(layout) if each >= 0), 0)


def respelled(
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
        slow, texts = _restyled(data, np.flatnonzero(odd), start, length, value, limit, more)
    out = np.empty(len(data) + _WIDEST * len(start) + len(texts), np.uint8)
    size = respell(
        text, start, length, old, value, limit, more, slow, np.frombuffer(texts, np.uint8),
        aligned, out,
    )  # fmt: skip
    return out[:size].tobytes()


def _restyled(
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
        text = restyled(token, float(value[t]), least=0 if shown >= enough[t] else int(least[t]))
        texts.append(text)
        size[t + 1] = len(text)
    return np.cumsum(size), b"".join(texts)
