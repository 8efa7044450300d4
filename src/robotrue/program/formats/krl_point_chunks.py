"""The survey of stored points: the elements of arrays in a ``.dat``.

A stretch is assignments to elements of one array, ``name[k]={X ..}`` with nothing left out, by
growing ``k``. In the skeleton its first and last line stand for it; whatever the program does with
an element it chose by a computed number it does with all of them. An array with an element that a
file names by a written number is not surveyed.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from robotrue.core.arrays import BoolArray, Bytes, IntArray, Ints
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.program.formats.file_survey import WindowLines, reason_column
from robotrue.program.formats.krl_scan import (
    AXIS,
    EMPTY,
    EXTERNAL,
    INLINE_LIN,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
)
from robotrue.program.formats.krl_survey import KrlSurvey, line_edges
from robotrue.program.program import Motion, Program
from robotrue.program.program_chunk import Whole

_BLANK, _TAB, _QUOTE, _APOSTROPHE, _COMMA, _EQUALS = (ord(sign) for sign in " \t\"',=")
_OPEN, _CLOSE, _BRACE, _ZERO, _NINE, _A, _Z = (ord(sign) for sign in "[]}09AZ")
_SMALL: Final = ord("a") - ord("A")
_LONGEST: Final = 256
_ELEMENT: Final = re.compile(rb"\b(\w++)\s*+\[\s*+(\d++)\s*+\]")
_NO_POINT: Final = re.compile(
    rb"\$|\b(?:BASE_DATA|TOOL_DATA|LOAD_DATA|FDAT_ACT|PDAT_ACT|LDAT_ACT|FDAT|PDAT|LDAT|LOAD)\b",
    re.IGNORECASE,
)


class Shape:
    """What the last point was called, for the next window: kept between calls of the kernel."""

    def __init__(self) -> None:
        self.letters = np.zeros(_LONGEST, np.uint8)
        self.numbers = np.array([-1, -1, 0], np.int64)  # length or -1, index, is an axis target


class PointSurvey(KrlSurvey):
    """One pass over a ``.dat``."""

    events = "statements that are no elements of arrays"

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets, axes_at_rest=axes_at_rest)
        self._shape = Shape()
        self._plain: BoolArray = np.zeros(0, np.bool_)
        self._tail: tuple[int, bytes] | None = None  # last line of the stretch that is open
        self._spans: dict[bytes, list[tuple[int, int, bool]]] = defaultdict(list)
        self._element: tuple[bytes, int] | None = None

    def _sort_scan(self, found: Scan) -> WindowLines:
        plain, begins = _point_lines(found, self._shape)
        self._plain = plain
        self._external.add(found, plain)
        event = np.asarray((found.line_kind == STATEMENT) & ~plain)
        targets = plain.astype(np.int64)
        return WindowLines(found.data, *line_edges(found), targets, plain, event, begins)

    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        code = lines.code(line)
        self._represent(line, code)
        element = _ELEMENT.search(code)
        self._element = (element[1].lower(), int(element[2])) if element else None

    def _continue_stretch(self, lines: WindowLines, since: int, until: int) -> None:
        plain = np.flatnonzero(self._plain[since:until])
        if len(plain):
            last = since + int(plain[-1])
            self._tail = (self.lines + last, lines.code(last))

    def _end_stretch(self) -> None:
        last = -1
        if self._tail is not None:
            line, code = self._tail
            self._represent(line - self.lines, code)
            element = _ELEMENT.search(code)
            last = int(element[2]) if element else -1
        if self._element is not None:
            name, first = self._element
            self._spans[name].append((first, max(first, last), self._tail is not None))
        self._tail = self._element = None

    def _check_end(self) -> Whole | None:
        for name, spans in self._spans.items():
            ordered = sorted(spans)
            if any(one[1] >= other[0] for one, other in pairwise(ordered)):
                return Whole(why=f"an element of {name.decode('latin-1')} is given twice")
        return super()._check_end()

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the rule of every stretch (s, 5), or why there is none."""
        table = super().judge(skeleton, others)
        if isinstance(table, Whole):
            return table
        for name in (name for name, spans in self._spans.items() if any(s[2] for s in spans)):
            by_number = re.compile(rb"\b" + re.escape(name) + rb"\s*\[[\s\d,]*\]", re.IGNORECASE)
            if any(by_number.search(data) for _, data in others):
                return Whole(why=f"an element of {name.decode('latin-1')} is named by its number")
        stretch, used = self._shown_stretch, skeleton.motion != Motion.UNUSED
        table[stretch, 4] = skeleton.motion
        differ = table[stretch, 4] != skeleton.motion
        differ |= table[stretch, reason_column(skeleton)] != skeleton.reason
        # No frame is in force where no motion goes.
        differ |= used & (table[stretch, 0] != skeleton.frame)
        differ |= used & (table[stretch, 1] != skeleton.tool)
        if differ.any():
            return Whole(why="points of one array are used in different ways")
        return table


def as_motions(found: Scan) -> Scan:
    """Returns a scan in which points of stretches stand as plain motions, and nothing else does."""
    plain, _ = _point_lines(found, Shape())
    line_kind = np.where(plain, INLINE_LIN, EMPTY).astype(np.uint8)
    return replace(found, line_kind=line_kind)


def _point_lines(found: Scan, shape: Shape) -> tuple[BoolArray, BoolArray]:
    """Returns which lines are plain points, and where a stretch begins."""
    plain, begins = _points(
        np.frombuffer(found.data, np.uint8), found.line_start, found.line_end, found.line_kind,
        found.agg_line, found.agg_open, found.agg_close, found.agg_flag, found.agg_token,
        found.tok_component, shape.letters, shape.numbers,
    )  # fmt: skip
    for line in np.flatnonzero(begins).tolist():
        code = found.data[int(found.line_start[line]) : int(found.line_end[line])]
        if _NO_POINT.search(code.partition(b"=")[0]):
            after = np.flatnonzero(begins[line + 1 :] | ~plain[line + 1 :])
            end = line + 1 + (int(after[0]) if len(after) else len(plain) - line - 1)
            plain[line:end], begins[line] = False, False
            if end == len(plain):
                shape.numbers[0] = -1
    return plain, begins


@compile_kernel(PLAIN)
def _points(
    buf: Bytes, line_start: Ints, line_end: Ints, line_kind: Bytes, agg_line: Ints, agg_open: Ints,
    agg_close: Ints, agg_flag: Bytes, agg_token: Ints, component: Bytes, letters: Bytes,
    numbers: IntArray,
) -> tuple[BoolArray, BoolArray]:  # fmt: skip
    """Returns which lines are plain points and where a stretch begins; renews the shape."""
    plain = np.zeros(line_kind.size, np.bool_)
    begins = np.zeros(line_kind.size, np.bool_)
    here = np.empty(letters.size, np.uint8)
    agg = 0
    for line in range(line_kind.size):
        first = agg
        while agg < agg_line.size and agg_line[agg] == line:
            agg += 1
        if line_kind[line] == EMPTY:
            continue
        size, index, axis = -1, -1, 0
        if line_kind[line] == STATEMENT and agg - first == 1:
            axis = _point_kind(agg_flag[first], component, agg_token[first], agg_token[agg])
            if axis >= 0 and _ends(buf, agg_close[first] + 1, line_end[line]):
                size, index = _read_name(buf, line_start[line], agg_open[first], here)
        if size < 0:
            numbers[0] = -1
            continue
        plain[line] = True
        same = size == numbers[0] and axis == numbers[2] and index > numbers[1] and index >= 0
        for k in range(size if same else 0):
            same &= here[k] == letters[k]
        begins[line] = not same
        letters[:] = here
        numbers[0], numbers[1], numbers[2] = size, index, axis
    return plain, begins


@compile_kernel(PLAIN)
def _point_kind(flag: int, component: Bytes, token: int, end: int) -> int:
    """Returns 0 for a whole pose, 1 for whole axis values, -1 for anything else."""
    pose, axis = 0, 0
    for t in range(token, end):
        pose += component[t] < AXIS
        axis += AXIS <= component[t] < EXTERNAL
    if flag & NOT_CONSTANT or pose + axis != 6 or (pose > 0 and axis > 0):
        return -1
    return 1 if axis else 0


@compile_kernel(PLAIN)
def _ends(buf: Bytes, i: int, end: int) -> bool:
    """Returns whether nothing follows a point but the rest of a structure."""
    while i < end and (buf[i] == _BLANK or buf[i] == _TAB):
        i += 1
    return i >= end or buf[i] == _COMMA or buf[i] == _BRACE


@compile_kernel(PLAIN)
def _read_name(buf: Bytes, i: int, end: int, out: Bytes) -> tuple[int, int]:
    """Writes what stands before a point, its index left out; returns (length or -1, index)."""
    size, index, brackets, assigned = 0, -1, 0, False
    while i < end:
        c = buf[i]
        i += 1
        if c == _QUOTE or c == _APOSTROPHE or size >= out.size:
            return -1, -1
        assigned |= c == _EQUALS
        if c == _OPEN:
            brackets += 1
            index = 0
            digits = 0
            while i < end and buf[i] != _CLOSE:
                if _ZERO <= buf[i] <= _NINE:
                    index = index * 10 + (buf[i] - _ZERO)
                    digits += 1
                elif buf[i] != _BLANK and buf[i] != _TAB:
                    return -1, -1
                i += 1
            if digits == 0 or digits > 9 or brackets > 1:
                return -1, -1
        out[size] = c + _SMALL if _A <= c <= _Z else c
        size += 1
    return (size, index) if assigned else (-1, -1)
