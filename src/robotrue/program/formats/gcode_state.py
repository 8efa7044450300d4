"""What is in force at every block, and which word a left-out one is inherited from."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.gcode_blocks import ALL, Blocks
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_vocabulary import Group

_ANEW: Final = (Group.INCH, Group.FRAME, Group.TIP, Group.SHIFTED, Group.TOOL)
"""States whose change gives coordinates another meaning."""


def in_force(blocks: Blocks) -> IntArray:
    """Returns the state (l, groups) that holds in every block; 0 before anything is said."""
    out = np.empty_like(blocks.state)
    rows = np.arange(len(out))
    for group in Group:
        said = blocks.state[:, group]
        if group == Group.TOOL and blocks.findings.changes:
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


def epochs(blocks: Blocks, force: IntArray, column: int, rows: IntArray) -> IntArray:
    """Returns a number for blocks ``rows`` (n,); a word is inherited within one number only."""
    count = np.zeros(len(blocks.first) + 1, np.int64)
    if column in ALL:
        anew = force[1:][:, _ANEW] != force[:-1][:, _ANEW]
        count[1:-1] += anew.any(axis=1)
    for block, columns in blocks.findings.lost.items():
        count[block + 1] += column in columns
    return np.asarray(np.cumsum(count)[rows])


def inherited(value: Array, given: BoolArray, epoch: IntArray) -> Array:
    """Returns the column (n,) with left-out words filled in, NaN where they are not known.

    Args:
        value: (n,) as printed.
        given: (n,) the row has the word; its value may be NaN.
        epoch: (n,) see :func:`epochs`.
    """
    rows = np.arange(len(value))
    donor = np.maximum.accumulate(np.where(given, rows, -1))
    fine = (donor >= 0) & (epoch[donor] == epoch)
    return np.where(fine, value[donor], np.nan)
