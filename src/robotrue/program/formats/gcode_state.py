"""What is in force at every block, and which word a left-out one is inherited from."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.gcode_blocks import ALL, POINT, Blocks
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_vocabulary import Modal

_ANEW: Final = (
    Modal.INCH,
    Modal.FRAME,
    Modal.TIP,
    Modal.SHIFTED,
    Modal.TOOL,
)
"""States whose change gives coordinates another meaning."""


def in_force(blocks: Blocks) -> IntArray:
    """Returns the state (l, groups) that holds in every block; 0 before anything is said."""
    out = np.empty_like(blocks.state)
    rows = np.arange(len(out))
    for group in Modal:
        said = blocks.state[:, group]
        if group == Modal.TOOL and blocks.findings.changes:
            said = _changed_tools(said, blocks.findings.changes)
        last = np.maximum.accumulate(np.where(said != NO_STATE, rows, -1))
        out[:, group] = np.where(last >= 0, said[last], 0)
    return out


def _changed_tools(said: IntArray, changes: list[int]) -> IntArray:
    """T chooses the next tool, M6 puts it in."""
    rows = np.arange(len(said))
    last = np.maximum.accumulate(np.where(said != NO_STATE, rows, -1))
    out = np.full(len(said), NO_STATE)
    at = np.array(changes)
    out[at] = np.where(last[at] >= 0, said[last[at]], 0)
    return out


class Epochs:
    """Stretches of a program inside which a left-out word is inherited."""

    def __init__(self, blocks: Blocks, force: IntArray) -> None:
        self._lost = blocks.findings.lost
        anew = force[1:, _ANEW] != force[:-1, _ANEW]
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
