"""Blocks that go somewhere: their words, what is in force there, and what they inherit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.gcode_blocks import ALL, POINT, Blocks
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_vocabulary import UNCERTAIN, Modal
from robotrue.program.formats.number_table import Numbers

_ANEW: Final = (
    Modal.INCH,
    Modal.FRAME,
    Modal.TIP,
    Modal.SHIFTED,
    Modal.TOOL,
)
"""States whose change gives coordinates another meaning."""


def in_force(blocks: Blocks) -> IntArray:
    """Returns the state (l, groups) in force in every block; 0 before any is set."""
    out = np.empty_like(blocks.state)
    rows = np.arange(len(out))
    for group in Modal:
        said = stated_column(blocks, group)
        last = np.maximum.accumulate(np.where(said != NO_STATE, rows, -1))
        out[:, group] = np.where(last >= 0, said[last], 0)
    return out


def stated_column(blocks: Blocks, group: Modal) -> IntArray:
    """Returns the settings (l,) of a state; of the tool those where it is loaded."""
    said = blocks.state[:, group]
    changes = blocks.findings.changes if group == Modal.TOOL else []
    return _changed_tools(said, changes) if changes else said


def _changed_tools(said: IntArray, changes: list[int]) -> IntArray:
    """T chooses the next tool, M6 loads it."""
    rows = np.arange(len(said))
    last = np.maximum.accumulate(np.where(said != NO_STATE, rows, -1))
    out = np.full(len(said), NO_STATE)
    at = np.array(changes)
    out[said == UNCERTAIN] = UNCERTAIN
    out[at] = np.where(last[at] >= 0, said[last[at]], 0)
    return out


class Epochs:
    """Stretches of a program inside which a left-out word is inherited."""

    def __init__(self, blocks: Blocks, force: IntArray) -> None:
        self._lost = blocks.findings.lost
        anew = force[1:, _ANEW] != force[:-1, _ANEW]
        made = [block for block, *_ in blocks.findings.frames]
        if made:  # a work frame is elsewhere from its next call on
            stated = np.flatnonzero(blocks.state[:, Modal.FRAME] != NO_STATE)
            anew[stated[stated > made[0]] - 1, _ANEW.index(Modal.FRAME)] = True
        self._anew = np.pad(anew.any(axis=1).astype(np.int64), 1)
        local = [block - 1 for block, *_ in blocks.findings.local if block]
        anew[local, _ANEW.index(Modal.FRAME)] = False  # a local zero turns nothing
        self._turned = np.pad(anew.any(axis=1).astype(np.int64), 1)
        self._known: dict[tuple[bool, ...], IntArray] = {}

    def of(self, column: int, rows: IntArray) -> IntArray:
        """Returns the number of the stretch of blocks ``rows`` (n,) for a column."""
        loses_here = (column in columns for columns in self._lost.values())
        key = (column in ALL, column in POINT, *loses_here)
        if key not in self._known:
            count = (self._anew if key[1] else self._turned) * key[0]
            for block, loses in zip(self._lost, key[2:], strict=True):
                count[block + 1] += loses
            self._known[key] = np.cumsum(count)
        return np.asarray(self._known[key][rows])


def fill_left_out(value: Array, given: BoolArray, epoch: IntArray) -> Array:
    """Returns the column (n,) with left-out words filled in, NaN where they are not known.

    Args:
        value: (n,) as printed.
        given: (n,) the row has the word; its value may be NaN.
        epoch: (n,) see :class:`Epochs`.
    """
    rows = np.arange(len(value))
    donor = np.maximum.accumulate(np.where(given, rows, -1))
    fine = (donor >= 0) & (epoch[donor] == epoch)
    return np.where(fine, value[donor], np.nan)


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
        """Returns the numbers (m, w) of some columns, and a mask of those present."""
        shape = (self._count, len(columns))
        if self._present.isdisjoint(columns):
            return _make_empty(shape), np.zeros(shape, np.bool_)
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


def _make_empty(shape: tuple[int, int]) -> Numbers:
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
