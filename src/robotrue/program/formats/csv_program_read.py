"""Reads a tool path as CSV with the bytes of its points."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.gcode_arcs import no_arcs
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.path_kernels import find_cell_numbers
from robotrue.program.formats.path_tools import find_named_tools
from robotrue.program.formats.path_words import PathWords, Turn, poses
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.formats.toolpath_csv import AXIS, POSITION, ToolpathTable, toolpath_of
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NAMES: Final = (b"",) * 6


def read_csv_program(data: bytes, name: str, frames: FrameTable) -> Program:
    """Returns the program of a tool path as CSV.

    Raises:
        FormatError: A column that is missing or not known, a cell that cannot be read; with line.
    """
    require_text(data, name)
    try:
        table = ToolpathTable(data, name)
        path = toolpath_of(table)
    except ImplausibleDataError as error:
        raise FormatError(error.message, source=name, line=1, hint=error.hint) from None
    numbers, by_axis = _find_numbers(data, table)
    n = len(path)
    value = numbers.value.copy()
    if not by_axis:
        value[:, 3:] = (0.0, 0.0, 1.0)
    turn = np.full(n, int(Turn.VECTOR if by_axis else Turn.FIXED))
    unit, rule = np.full(n, MM), frames.orientation
    position, rotation, axes = poses(value, unit, turn, rule, path.line)
    reason, notes = np.zeros(n, np.int64), TargetNotes(name, path.line)
    odd = np.asarray(~np.isfinite(position).all(axis=1) | ~np.isfinite(value).all(axis=1))
    reason[odd] = Reason.EXPRESSION
    notes.rows(odd, "a number of a form that is not rewritten")
    if rule.spin is None:
        reason[~odd] = Reason.INCOMPLETE
        notes.rows(~odd, "only the tool axis is stated: state [controller] spin_deg in the cell")
    used, names = table.words("tool", "")
    tool, tools = find_named_tools(frames, used, dict(enumerate(names)), reason, notes)
    return Program(
        name=name, dialect="toolpath_csv", data=data, position=position, rotation=rotation,
        axes=axes, motion=np.full(n, int(Motion.LIN)), reason=reason,
        words=np.empty((n, 0), np.int64), words_of="", line=path.line,
        frame=np.zeros(n, np.int64), tool=tool, T_base_frame=np.asarray(frames.T_base_frame)[None],
        T_flange_tool=tools, notes=notes.notes(), noted=notes.on_lines(),
        spans=PathWords(
            numbers=numbers, value=value, unit=unit, turn=turn, skip=np.zeros(n, np.bool_),
            at=np.full(n, -1), barred=np.ones((n, 6), np.bool_), names=(_NAMES,) * 4, blank=False,
            rule=rule, arcs=no_arcs(), marks=np.empty((n, 0, 2), np.int64),
        ),
    )  # fmt: skip


def _find_numbers(data: bytes, table: ToolpathTable) -> tuple[Numbers, bool]:
    """Returns the words (n, 6), and whether the table has tool axes."""
    by_axis = AXIS[0] in table.names
    wanted = (*POSITION, *AXIS) if by_axis else POSITION
    begin = line_starts(data)[np.array(table.lines) - 1].astype(np.int64)
    column = [wanted.index(name) if name in wanted else -1 for name in table.names]
    start, length = np.full((len(begin), 6), -1), np.zeros((len(begin), 6), np.int64)
    find_cell_numbers(
        np.frombuffer(data, np.uint8), begin, ord(table.mark), np.array(column), start, length
    )
    value = np.full(start.shape, np.nan)
    value[:, : len(wanted)] = table.block(wanted)
    value[start < 0] = np.nan
    return Numbers(start=start, length=length, value=value), by_axis
