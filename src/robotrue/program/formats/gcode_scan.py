"""Scans the blocks of a G-code file: the plain ones compiled, the odd ones one by one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.program.formats.gcode_blocks import Blocks, Findings, with_findings
from robotrue.program.formats.gcode_kernels import NO_STATE, ODD, count_letters, read_blocks
from robotrue.program.formats.gcode_vocabulary import (
    Modal,
    Vocabulary,
    code_tables,
    column_table,
)
from robotrue.program.formats.text_lines import line_starts, require_text

_LARGEST: Final = 1e8
"""Of any number in a block; 100 km."""
Take = Callable[[int, int, bytes], None]
"""Takes an odd block: its number, its first byte, its text without the comment."""


def scan_blocks(
    data: bytes, name: str, vocabulary: Vocabulary, reader: Callable[[Vocabulary, Findings], Take]
) -> Blocks:
    """Returns what all blocks say.

    Args:
        data: The bytes.
        name: Of the file, for messages.
        vocabulary: The control.
        reader: Makes the slow reader.

    Raises:
        FormatError: Not text, or what the slow reader refuses.
    """
    require_text(data, name)
    text, first = np.frombuffer(data, np.uint8), line_starts(data)
    last = np.append(first[1:], len(data))
    count, room = len(first), int(count_letters(text))
    status, end = np.zeros(count, np.int64), np.zeros(count, np.int64)
    state = np.full((count, len(Modal)), NO_STATE, np.int32)
    block, column = np.empty(room, np.int64), np.empty(room, np.int64)
    start, length, value = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room)
    size = read_blocks(
        text, first, last, column_table(vocabulary), *code_tables(vocabulary),
        np.array(vocabulary.signs), status, end, state, block, column, start, length, value,
    )  # fmt: skip
    columns = tuple(each[:size] for each in (block, column, start, length, value))
    for k in np.flatnonzero(np.isnan(columns[4])).tolist():
        at = int(columns[2][k])
        columns[4][k] = float(data[at : at + int(columns[3][k])])
    found = Findings(groups=vocabulary.groups)
    take = reader(vocabulary, found)
    for row in np.flatnonzero(status == ODD).tolist():
        take(row, int(first[row]), data[int(first[row]) : int(end[row])])
    for (row, group), setting in found.state.items():
        state[row, group] = setting
    block, column, start, length, value = with_findings(columns, found)  # type: ignore[arg-type]
    value = np.where(np.abs(value) < _LARGEST, value, np.nan)
    return Blocks(
        data=data, first=first, end=end, state=state.astype(np.int64), block=block, column=column,
        start=start, length=length, value=value, findings=found,
    )  # fmt: skip
