"""Reads a tool path as CSV with the bytes of its points."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.gcode_arcs import no_arcs
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.path_words import PathWords, Turn, poses
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.formats.toolpath_csv import AXIS, POSITION, read_toolpath_csv
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NUMBER: Final = re.compile(WHOLE_NUMBER)
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
    header = _header_line(data)
    numbers, by_axis = _numbers(data, header, path.line)
    n = len(path)
    value = numbers.value.copy()
    if not by_axis:
        value[:, 3:] = (0.0, 0.0, 1.0)
    turn = np.full(n, int(Turn.VECTOR if by_axis else Turn.FIXED))
    unit, rule = np.full(n, MM), frames.orientation
    position, rotation, axes = poses(value, unit, turn, rule)
    reason, notes = np.zeros(n, np.int64), TargetNotes(name, path.line)
    odd = np.asarray(~np.isfinite(position).all(axis=1))
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


def _header_line(data: bytes) -> bytes:
    for line in re.split(rb"\r\n|\n|\r", data.removeprefix(b"\xef\xbb\xbf")):
        if line.strip() and not line.lstrip().startswith(b"#"):
            return line
    return b""


def _numbers(data: bytes, header: bytes, line: IntArray) -> tuple[Numbers, bool]:
    """Returns the words (n, 6), and whether the table has tool axes."""
    mark = b";" if b";" in header else b","
    names = [_bare(header, *span).lower().decode() for span in _cells(header, mark)]
    by_axis = AXIS[0] in names
    columns = [names.index(each) for each in (*POSITION, *(AXIS if by_axis else ()))]
    starts = line_starts(data)
    shape = (len(line), 6)
    start, length = np.full(shape, -1), np.zeros(shape, np.int64)
    value: Array = np.full(shape, np.nan)
    for row, number in enumerate(line.tolist()):
        first = int(starts[number - 1])
        last = int(starts[number]) if number < len(starts) else len(data)
        text = data[first:last]
        if text.startswith(b"\xef\xbb\xbf"):
            first, text = first + 3, text[3:]
        cells = _cells(text.rstrip(b"\r\n"), mark)
        for k, column in enumerate(columns):
            begin, end = _stripped(text, *cells[column])
            token = text[begin:end]
            if _NUMBER.fullmatch(token):
                start[row, k], length[row, k] = first + begin, end - begin
                value[row, k] = float(token)
    return Numbers(start=start, length=length, value=value), by_axis


def _cells(text: bytes, mark: bytes) -> list[tuple[int, int]]:
    """Returns first byte and end of every cell; marks in quotes do not count."""
    if b'"' not in text:
        out, at = [], 0
        for cell in text.split(mark):
            out.append((at, at + len(cell)))
            at += len(cell) + 1
        return out
    ends, quoted = [], False
    for at in range(len(text)):
        quoted ^= text[at : at + 1] == b'"'
        if text[at : at + 1] == mark and not quoted:
            ends.append(at)
    return list(zip([0, *(end + 1 for end in ends)], [*ends, len(text)], strict=True))


def _stripped(text: bytes, begin: int, end: int) -> tuple[int, int]:
    while begin < end and text[begin : begin + 1] in (b" ", b"\t", b'"'):
        begin += 1
    while begin < end and text[end - 1 : end] in (b" ", b"\t", b'"', b"\r", b"\n"):
        end -= 1
    return begin, end


def _bare(text: bytes, begin: int, end: int) -> bytes:
    begin, end = _stripped(text, begin, end)
    return text[begin:end]
