"""Long tool paths: points of APT or CL data, and of CSV files."""

from __future__ import annotations

import contextlib
import re
from array import array
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.apt_program_read import is_continued
from robotrue.program.formats.number_table import NumberTable, read_tokens
from robotrue.program.formats.path_kernels import find_cell_numbers
from robotrue.program.formats.splice_chunks import (
    NO_TURN,
    VECTOR,
    PointLines,
    SpliceCutter,
    SpliceSurvey,
)
from robotrue.program.formats.text_lines import line_edges

_GAP: Final = rb"(?:\$[ \t]*+\r?\n[ \t]*+)?+,(?:[ \t]*+\$[ \t]*+\r?\n)?+"
_CELL: Final = rb"[ \t]*+[+-]?(?:\d{1,7}+(?:\.\d*+)?|\.\d++)[ \t]*+"
"""A number that any coordinate can be; larger ones are left alone by the reader."""
_THREE: Final = _GAP.join([_CELL] * 3)
_POINT: Final = re.compile(
    rb"^[ \t]*+GOTO[ \t]*+/" + _THREE + rb"(" + _GAP + _THREE + rb")?(?=\r?$)",
    re.IGNORECASE | re.MULTILINE,
)
"""A statement that is nothing but a point of three or six numbers, also over several lines."""
_CONTINUED: Final = re.compile(rb"\$[ \t]*+\r?\n")
_IDLE: Final = re.compile(
    rb"[ \t]*+(?:(?:FEDRAT|RAPID|SPINDL|COOLNT|PPRINT|PAINT)\b[^$\r\n\x80-\xff]*+)?+[\r\n]*+",
    re.IGNORECASE,
)
"""Statements without effect on points, nor on the encoding of the file."""


class AptSurvey(SpliceSurvey):
    """One pass over a file of APT or CL data."""

    def _sort_points(self, data: bytes) -> PointLines:
        edges = line_edges(data)
        count = len(edges) - 1
        continued = _find_continued(data, edges)
        found = array("q")
        for match in _POINT.finditer(data):
            found.extend((match.start(), match.end(), match.start(1)))
        places = np.array(found, np.int64).reshape(-1, 3)
        first = np.searchsorted(edges, places[:, 0], side="right") - 1
        plain = ~continued[first]
        places, first = places[plain], first[plain]
        targets, turn = np.zeros((2, count), np.int64)
        axis, end, event = np.full((count, 3), np.nan), edges[1:].copy(), np.ones(count, np.bool_)
        targets[first], end[first], event[first] = 1, places[:, 1], False
        last = np.searchsorted(edges, places[:, 1], side="left") - 1
        for k in np.flatnonzero(last > first).tolist():
            event[first[k] : last[k] + 1] = False
        axes = NumberTable(data, [range(3)], b"$")
        six = places[:, 2] >= 0
        for start, stop in zip(places[six, 2].tolist(), places[six, 1].tolist(), strict=True):
            axes.add(start, stop, 0)
        turn[first[six]], axis[first[six]] = VECTOR, axes.numbers().value
        for row in np.flatnonzero(event).tolist():
            idle = _IDLE.fullmatch(data, int(edges[row]), int(edges[row + 1]))
            event[row] = continued[row] or not idle
        return PointLines(
            start=edges[:-1], end=end, targets=targets, event=event, turn=turn, full=targets > 0,
            mode=np.zeros(count, np.int64), axis=axis,
        )  # fmt: skip

    def _find_end(self, data: bytes) -> int:
        cut = super()._find_end(data)
        while is_continued(data, cut):
            cut = data.rfind(b"\n", 0, cut - 1) + 1
        return cut

    def _one_line(self, code: bytes) -> bytes:
        return _CONTINUED.sub(b"", code)


def _find_continued(data: bytes, edges: IntArray) -> BoolArray:
    """Returns the lines (l,) after one that ends with a dollar sign."""
    out = np.zeros(len(edges), np.bool_)
    for sign in np.flatnonzero(np.frombuffer(data, np.uint8) == ord("$")).tolist():
        after = int(np.searchsorted(edges, sign, side="right"))
        out[after] = not data[sign + 1 : int(edges[after])].strip()
    return out[:-1]


class CsvSurvey(SpliceSurvey):
    """One pass over a table of points."""

    _turn_of_all = -1
    _columns: IntArray
    _mark = 0

    def _sort_points(self, data: bytes) -> PointLines:
        edges = line_edges(data)
        text = np.frombuffer(data, np.uint8)
        targets = np.ones(len(edges) - 1, np.int64)
        event = np.zeros(len(targets), np.bool_)
        letter = text[edges[:-1]]
        for row in np.flatnonzero((letter <= 32) | (letter == 35) | (letter > 126)).tolist():
            line = data[int(edges[row]) : int(edges[row + 1])].removeprefix(b"\xef\xbb\xbf")
            line = line.strip(b" \t\r\n")
            targets[row] = line[:1].isascii() and line[:1] not in (b"", b"#")
            event[row] = not line[:1].isascii()
        marks = np.flatnonzero(event | (targets > 0))
        if self._turn_of_all < 0 and len(marks):
            row = int(marks[0])
            self._read_header(data[int(edges[row]) : int(edges[row + 1])])
            targets[row], event[row] = 0, True
        return PointLines(
            start=edges[:-1], end=edges[1:], targets=targets, event=event,
            turn=np.where(targets > 0, self._turn_of_all, NO_TURN), full=targets > 0,
            mode=np.zeros_like(targets), axis=self._axes_of(data, edges[:-1], targets > 0),
        )  # fmt: skip

    def _read_header(self, line: bytes) -> None:
        self._mark = ord(";") if b";" in line else ord(",")
        line = line.removeprefix(b"\xef\xbb\xbf").lower().replace(b'"', b"")
        names = [cell.strip() for cell in line.split(bytes([self._mark]))]
        self._columns = np.array([b"ijk".find(each or b"?") for each in names])
        self._turn_of_all = VECTOR if b"i" in names else NO_TURN

    def _axes_of(self, data: bytes, begin: IntArray, rows: BoolArray) -> Array:
        """Returns the tool axes (l, 3) of the lines that are rows, NaN for others."""
        out = np.full((len(begin), 3), np.nan)
        if self._turn_of_all == VECTOR:
            mine = np.flatnonzero(rows)
            start, length = np.full((len(mine), 3), -1), np.zeros((len(mine), 3), np.int64)
            find_cell_numbers(
                np.frombuffer(data, np.uint8), begin[mine], self._mark, self._columns, start, length
            )
            with contextlib.suppress(ValueError):  # no number: the reader refuses its block
                out[mine] = read_tokens(data, start, length)
        return out


APT: Final = SpliceCutter(survey=AptSurvey)
CSV: Final = SpliceCutter(survey=CsvSurvey)
