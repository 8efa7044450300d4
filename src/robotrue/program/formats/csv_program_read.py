"""Reads a tool path as CSV with the bytes of its points."""

from __future__ import annotations

import re
from array import array
from itertools import chain
from typing import Final

import numpy as np

from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.gcode_arcs import no_arcs
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.path_words import PathWords, Turn, poses
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.formats.toolpath_csv import AXIS, POSITION, ToolpathTable, toolpath_of
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NUMBER: Final = rb"(?:[ \t\"]*+(" + WHOLE_NUMBER + rb")[ \t\"]*+(?=MARK|[\r\n]|\Z)|"
"""A cell with a number of a form that can be rewritten, or another one."""
_OTHER: Final = rb"(?:\"(?:[^\"\r\n]|\"\")*+\")?+[^MARK\r\n]*+"
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
    position, rotation, axes = poses(value, unit, turn, rule)
    reason, notes = np.zeros(n, np.int64), TargetNotes(name, path.line)
    odd = np.asarray(~np.isfinite(position).all(axis=1) | ~np.isfinite(value).all(axis=1))
    reason[odd] = Reason.EXPRESSION
    notes.rows(odd, "a number of a form that is not rewritten")
    if rule.spin is None:
        reason[~odd] = Reason.INCOMPLETE
        notes.rows(~odd, "only the tool axis is known: state [controller] spin_deg in the cell")
    return Program(
        name=name, dialect="toolpath_csv", data=data, position=position, rotation=rotation,
        axes=axes, motion=np.full(n, int(Motion.LIN)), reason=reason,
        words=np.empty((n, 0), np.int64), words_of="", line=path.line,
        frame=np.zeros(n, np.int64), tool=np.zeros(n, np.int64),
        T_base_frame=np.asarray(frames.T_base_frame)[None],
        T_flange_tool=np.asarray(frames.T_flange_tool)[None], notes=notes.notes(),
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
    number, other = (form.replace(b"MARK", table.mark.encode()) for form in (_NUMBER, _OTHER))
    cells = [number + other + b")" if name in wanted else other for name in table.names]
    row = re.compile(table.mark.encode().join(cells))
    starts = line_starts(data)
    spans = array("q")
    for begin in starts[np.array(table.lines) - 1].tolist():
        match = row.match(data, begin)
        spans.extend(chain.from_iterable(match.regs[1:]) if match else (-1,) * 2 * len(wanted))
    order = [[name for name in table.names if name in wanted].index(name) for name in wanted]
    start, end = np.array(spans, np.int64).reshape(-1, len(wanted), 2)[:, order].transpose(2, 0, 1)
    value, length = np.where(start < 0, np.nan, table.block(wanted)), end - start
    if not by_axis:
        start = np.pad(start, ((0, 0), (0, 3)), constant_values=-1)
        length = np.pad(length, ((0, 0), (0, 3)))
        value = np.pad(value, ((0, 0), (0, 3)), constant_values=np.nan)
    return Numbers(start=start, length=length, value=value), by_axis
