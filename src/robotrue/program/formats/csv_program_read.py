"""Reads a tool path as CSV with the bytes of its points."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.gcode_arcs import no_arcs
from robotrue.program.formats.number_kernels import literal_numbers
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.path_lines import cell_spans
from robotrue.program.formats.path_words import PathWords, Turn, poses
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.formats.toolpath_csv import AXIS, POSITION, columns_of, read_toolpath_csv
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NUMBER: Final = re.compile(WHOLE_NUMBER)
_LONGEST: Final = 64
"""Bytes of a cell that is read compiled."""
_NAMES: Final = (b"",) * 6


def read_csv_program(data: bytes, name: str, frames: FrameTable) -> Program:
    """Returns the program of a tool path as CSV.

    Raises:
        FormatError: A column that is missing or not known, a cell that cannot be read; with line.
    """
    require_text(data, name)
    try:
        path = read_toolpath_csv(data, source=name)
    except ImplausibleDataError as error:
        raise FormatError(error.message, source=name, line=1, hint=error.hint) from None
    numbers, by_axis = _numbers(data, *columns_of(data, name), path.line)
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


def _numbers(data: bytes, mark: str, names: list[str], line: IntArray) -> tuple[Numbers, bool]:
    """Returns the words (n, 6), and whether the table has tool axes."""
    by_axis = AXIS[0] in names
    columns = [names.index(each) for each in (*POSITION, *(AXIS if by_axis else ()))]
    starts = line_starts(data)
    text = np.frombuffer(data, np.uint8)
    shape = (len(line), len(columns))
    begin, end = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    last = np.append(starts[1:], len(data))
    cell_spans(text, starts[line - 1], last[line - 1], ord(mark), np.array(columns), begin, end)
    start, length = np.full(shape, -1), np.zeros(shape, np.int64)
    value: Array = np.full(shape, np.nan)
    one = np.zeros((begin.size, 1), np.int64)
    found, size, read = one - 1, one.copy(), np.full(one.shape, np.nan)
    literal_numbers(
        text, begin.ravel(), np.minimum(end, begin + _LONGEST).ravel(), one[:, 0],
        np.zeros((1, _LONGEST + 1), np.int64), 0, found,
        size, read,
    )  # fmt: skip
    whole = (found.ravel() == begin.ravel()) & (size.ravel() == (end - begin).ravel())
    for k in np.flatnonzero(~whole | np.isnan(read[:, 0])).tolist():
        token = data[int(begin.flat[k]) : int(end.flat[k])]
        whole[k] = bool(_NUMBER.fullmatch(token))
        read[k] = float(token) if whole[k] else np.nan
    good = whole.reshape(shape)
    start[good], length[good] = begin[good], (end - begin)[good]
    value[good] = read.reshape(shape)[good]
    if not by_axis:
        start = np.pad(start, ((0, 0), (0, 3)), constant_values=-1)
        length = np.pad(length, ((0, 0), (0, 3)))
        value = np.pad(value, ((0, 0), (0, 3)), constant_values=np.nan)
    return Numbers(start=start, length=length, value=value), by_axis
