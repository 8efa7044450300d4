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
from typing import Any, Final

import numba
import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.core.compiled import cached
from robotrue.program.formats.krl_scan import (
    EMPTY,
    INLINE_LIN,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
)
from robotrue.program.formats.krl_survey import FULL, NOTHING, KrlSurvey
from robotrue.program.formats.long_survey import MOST_STRETCHES
from robotrue.program.program import Motion, Program
from robotrue.program.stream import Whole

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

    def __init__(self, name: str, targets: int) -> None:
        super().__init__(name, targets)
        self._shape = Shape()
        self._begins: BoolArray = np.zeros(0, np.bool_)
        self._tail: tuple[int, bytes] | None = None  # last line of the stretch that is open
        self._spans: dict[bytes, list[tuple[int, int, bool]]] = defaultdict(list)
        self._element: tuple[bytes, int] | None = None

    def _sorted(self, found: Scan) -> tuple[IntArray, IntArray, bool, bool]:
        kind, self._begins = _point_lines(found, self._shape)
        rows = (kind == FULL).astype(np.int64)
        away, still = _external(
            found.agg_line, found.agg_token, found.tok_component, found.tok_value, kind,
            self._first_external,
        )  # fmt: skip
        return rows, kind, bool(away), bool(still)

    def _stretches(self, found: Scan, kind: IntArray) -> Whole | None:
        plain = np.flatnonzero(kind == FULL)
        event = (found.line_kind == STATEMENT) & (kind != FULL)
        marks = np.flatnonzero(event | self._begins)
        if len(self.stretch) + len(marks) > MOST_STRETCHES:
            return Whole(
                why=f"more than {MOST_STRETCHES} statements that are no elements of arrays",
                line=self.lines + 1,
            )
        since = 0
        for mark in [*marks.tolist(), len(kind)]:
            at = int(np.searchsorted(plain, mark)) - 1
            if at >= 0 and plain[at] >= since:
                last = int(plain[at])
                self._tail = (self.lines + last, _code(found, last))
            since = mark + 1
            if mark == len(kind):
                break
            self._end()
            if event[mark]:
                self._write(mark, _code(found, mark))
            else:
                self._begin(mark, _code(found, mark))
        return None

    def _begin(self, line: int, code: bytes) -> None:
        self.stretch.append(self.lines + line)
        self._represent(line, code)
        element = _ELEMENT.search(code)
        self._element = (element[1].lower(), int(element[2])) if element else None

    def _end(self) -> None:
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

    def close(self) -> Whole | None:
        """Ends the pass; returns why the file must be read whole, if so."""
        self._end()
        for name, spans in self._spans.items():
            ordered = sorted(spans)
            if any(one[1] >= other[0] for one, other in pairwise(ordered)):
                return Whole(why=f"an element of {name.decode('latin-1')} is given twice")
        return super().close()

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the judgement of every stretch (s, 5), or why there is none."""
        refused = self.require_shown(skeleton.line - 1)
        if refused is not None:
            return refused
        for name in (name for name, spans in self._spans.items() if any(s[2] for s in spans)):
            by_number = re.compile(rb"\b" + re.escape(name) + rb"\s*\[[\s\d,]*\]", re.IGNORECASE)
            if any(by_number.search(data) for _, data in others):
                return Whole(why=f"an element of {name.decode('latin-1')} is named by its number")
        stretch = np.array([number for _, number in self.shown], np.int64)
        rows = np.column_stack(
            [skeleton.frame, skeleton.tool, skeleton.reason, skeleton.reason, skeleton.motion]
        )
        judged = np.zeros((len(self.stretch), 5), np.int64)
        judged[stretch] = rows
        differ = judged[stretch] != rows
        differ[skeleton.motion == Motion.UNUSED, :2] = False  # no frame is in force where none goes
        if differ.any() or (len(skeleton.held) and skeleton.held.any()):
            return Whole(why="points of one array are used in different ways")
        return judged


def as_motions(found: Scan) -> Scan:
    """Returns a scan in which points of stretches stand as plain motions, and nothing else does."""
    kind, _ = _point_lines(found, Shape())
    line_kind = np.where(kind == FULL, INLINE_LIN, EMPTY).astype(np.uint8)
    return replace(found, line_kind=line_kind)


def _code(found: Scan, line: int) -> bytes:
    return found.data[int(found.line_start[line]) : int(found.line_end[line])]


def _point_lines(found: Scan, shape: Shape) -> tuple[IntArray, BoolArray]:
    """Returns the kind of every line, and where a stretch begins."""
    kind, begins = _points(
        np.frombuffer(found.data, np.uint8), found.line_start, found.line_end, found.line_kind,
        found.agg_line, found.agg_open, found.agg_close, found.agg_flag, found.agg_token,
        found.tok_component, shape.letters, shape.numbers,
    )  # fmt: skip
    for line in np.flatnonzero(begins).tolist():
        if _NO_POINT.search(_code(found, line).partition(b"=")[0]):
            after = np.flatnonzero(begins[line + 1 :] | (kind[line + 1 :] != FULL))
            end = line + 1 + (int(after[0]) if len(after) else len(kind) - line - 1)
            kind[line:end], begins[line] = NOTHING, False
            if end == len(kind):
                shape.numbers[0] = -1
    return kind, begins


@cached
@numba.njit
def _points(
    buf: Any,
    line_start: Any,
    line_end: Any,
    line_kind: Any,
    agg_line: Any,
    agg_open: Any,
    agg_close: Any,
    agg_flag: Any,
    agg_token: Any,
    component: Any,
    letters: Any,
    numbers: Any,
) -> Any:
    """Returns the kind of every line and where a stretch begins; renews the shape."""
    kind = np.zeros(line_kind.size, np.int64)
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
            axis = _full(agg_flag[first], component, agg_token[first], agg_token[agg])
            if axis >= 0 and _ends(buf, agg_close[first] + 1, line_end[line]):
                size, index = _called(buf, line_start[line], agg_open[first], here)
        if size < 0:
            numbers[0] = -1
            continue
        kind[line] = FULL
        same = size == numbers[0] and axis == numbers[2] and index > numbers[1] and index >= 0
        for k in range(size if same else 0):
            same &= here[k] == letters[k]
        begins[line] = not same
        letters[:] = here
        numbers[0], numbers[1], numbers[2] = size, index, axis
    return kind, begins


@cached
@numba.njit
def _full(flag: Any, component: Any, token: Any, end: Any) -> Any:
    """Returns 0 for a whole pose, 1 for whole axis values, -1 for anything else."""
    pose, axis = 0, 0
    for t in range(token, end):
        pose += component[t] < 6
        axis += 6 <= component[t] < 12
    if flag & NOT_CONSTANT or pose + axis != 6 or (pose > 0 and axis > 0):
        return -1
    return 1 if axis else 0


@cached
@numba.njit
def _ends(buf: Any, i: Any, end: Any) -> Any:
    """Returns whether nothing follows a point but the rest of a structure."""
    while i < end and (buf[i] == 32 or buf[i] == 9):
        i += 1
    return i >= end or buf[i] == 44 or buf[i] == 125


@cached
@numba.njit
def _called(buf: Any, i: Any, end: Any, out: Any) -> Any:
    """Writes what stands before a point, its index left out; returns (length or -1, index)."""
    size, index, brackets, assigned = 0, -1, 0, False
    while i < end:
        c = buf[i]
        i += 1
        if c == 34 or c == 39 or size >= out.size:
            return -1, -1
        assigned |= c == 61
        if c == 91:
            brackets += 1
            index = 0
            digits = 0
            while i < end and buf[i] != 93:
                if 48 <= buf[i] <= 57:
                    index = index * 10 + (buf[i] - 48)
                    digits += 1
                elif buf[i] != 32 and buf[i] != 9:
                    return -1, -1
                i += 1
            if digits == 0 or digits > 9 or brackets > 1:
                return -1, -1
        out[size] = c + 32 if 65 <= c <= 90 else c
        size += 1
    return (size, index) if assigned else (-1, -1)


@cached
@numba.njit
def _external(
    agg_line: Any, agg_token: Any, component: Any, value: Any, kind: Any, first: Any
) -> Any:
    """Returns whether external axes are away from zero, and whether they stand still."""
    here = np.empty(6)
    away, still = False, True
    for agg in range(agg_line.size):
        if kind[agg_line[agg]] != FULL:
            continue
        here[:] = np.inf
        for t in range(agg_token[agg], agg_token[agg + 1]):
            code = component[t]
            if 12 <= code < 18:
                here[code - 12] = value[t]
                away |= value[t] != 0.0
        for k in range(6):
            if np.isnan(first[k]):
                first[k] = here[k]
            still &= first[k] == here[k]
    return away, still
