"""Tools that a list of points names: those of the cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.program import FrameTable, Reason


def find_named_tools(
    frames: FrameTable,
    used: IntArray,
    names: Mapping[int, str],
    reason: IntArray,
    notes: TargetNotes,
) -> tuple[IntArray, Array]:
    """Returns the tool (n,) of every point, and the tools (t, 4, 4).

    The tool of the cell serves a file with one; of several each must be in the table.

    Args:
        frames: Of the cell.
        used: (n,) number of the tool of every point.
        names: Of the tools by number; empty for the tool before any is named.
        reason: (n,) :class:`.program.Reason`, changed in place.
        notes: Get a sentence on each unknown tool.
    """
    given = {key.strip().upper(): matrix for key, matrix in frames.tools.items()}
    tools = [np.asarray(frames.T_flange_tool, dtype=np.float64)]
    index = np.zeros(len(used), np.int64)
    several = len(np.unique(used)) > 1
    for number in np.unique(used).tolist():
        name = names.get(number, "").strip().upper()
        if name in given:
            index[used == number] = len(tools)
            tools.append(np.asarray(given[name], dtype=np.float64))
        elif several:
            rows = (used == number) & (reason == Reason.NONE)
            reason[rows] = Reason.UNKNOWN_FRAME
            called = f"tool {name}" if name else "the tool before any that is named"
            notes.rows(rows, f"{called} is not in the frame table")
    return index, np.array(tools)
