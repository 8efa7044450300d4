"""Blocks of a G-code that go somewhere, and the words that stand in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.gcode_blocks import Blocks
from robotrue.program.formats.number_table import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Blocks that go somewhere, as columns.

    Attributes:
        block: (m,) number of each.
        force: (m, groups) what is in force.
        numbers: (m, 6) words of the point.
        value: (m, 6) with what is inherited.
        turn: (m,) :class:`.path_words.Turn`.
        epoch: (m,) of the coordinates.
        unit: (m,) m per printed length.
    """

    block: IntArray
    force: IntArray
    numbers: Numbers
    value: Array
    turn: IntArray
    epoch: IntArray
    unit: Array


class Words:
    """The words of chosen blocks, one column at a time."""

    def __init__(self, blocks: Blocks, rows: IntArray) -> None:
        self._blocks, self._count = blocks, len(rows)
        self._row = np.full(len(blocks.first), -1)
        self._row[rows] = np.arange(len(rows))
        self._present = set(np.flatnonzero(np.bincount(blocks.column, minlength=1)).tolist())

    def numbers(self, columns: tuple[int, ...]) -> tuple[Numbers, BoolArray]:
        """Returns the numbers (m, w) of some columns, and which of them stand there."""
        shape = (self._count, len(columns))
        if self._present.isdisjoint(columns):
            return _nothing(shape), np.zeros(shape, np.bool_)
        start, length = np.full(shape, -1), np.zeros(shape, np.int64)
        value, given = np.full(shape, np.nan), np.zeros(shape, np.bool_)
        blocks = self._blocks
        for k, column in enumerate(columns):
            mine = np.flatnonzero(blocks.column == column)
            row = self._row[blocks.block[mine]]
            mine, row = mine[row >= 0], row[row >= 0]
            start[row, k], length[row, k] = blocks.start[mine], blocks.length[mine]
            value[row, k], given[row, k] = blocks.value[mine], True
        return Numbers(start=start, length=length, value=value), given


def _nothing(shape: tuple[int, int]) -> Numbers:
    return Numbers(
        start=np.broadcast_to(np.int64(-1), shape),
        length=np.broadcast_to(np.int64(0), shape),
        value=np.broadcast_to(np.nan, shape),
    )


def choose_rows(mine: BoolArray, one: Numbers, other: Numbers) -> Numbers:
    """Returns rows of one table where ``mine``, else of the other."""
    if not mine.any():
        return other
    pick = mine[:, None]
    return Numbers(
        start=np.where(pick, one.start, other.start),
        length=np.where(pick, one.length, other.length),
        value=np.where(pick, one.value, other.value),
    )
