"""Long KRL files: the surveys of a ``.src`` with its motions inline and of points in a ``.dat``.

A stretch of motions is the text between two statements that may change frames, move the robot or
branch, poses or axis targets. A stretch of points is assignments to elements of one array,
``name[k]={X ..}`` with nothing left out, by growing ``k``; whatever the program does with an
element it chose by a computed number it does with all of them. An array with an element that a file
names by a written number is not surveyed.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.errors import FormatError
from robotrue.program.formats.file_survey import NO_KEY, Survey, WindowLines
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_columns import count_parts, target_numbers
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_operands import first_aggregates
from robotrue.program.formats.krl_scan import (
    EMPTY,
    INLINE_ARC,
    INLINE_LIN,
    INLINE_PTP,
    INLINE_SPLINE,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
    scan,
)
from robotrue.program.formats.krl_walk import KrlWalk
from robotrue.program.program import FrameTable, Program
from robotrue.program.program_chunk import ChunkLines, ReadChunk, Skeleton, Whole

NOTHING, FULL, PARTIAL, ODD, MIXED = 0, 1, 2, 3, 4
"""What a line holds: no plain motion; one that leaves nothing out; one that leaves something out;
one that is computed; an arc with axis values."""
_POSE_LINE: Final = b"LIN {X 0,Y 0,Z 0,A 0,B 0,C 0}"
_AXIS_LINE: Final = b"PTP {A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}"
_IDLE: Final = re.compile(
    rb"\s*(?:\$(?:VEL|ACC|VEL_AXIS|ACC_AXIS|APO|ADVANCE|OV_PRO|OUT)(?:\s*\[\s*\d+\s*\])?"
    rb"(?:\.\w+)?\s*=\s*(?:[+-]?\d+(?:\.\d*)?|[+-]?\.\d+|TRUE|FALSE)|WAIT\s+SEC\s+[\d.]+|HALT)\s*",
    re.IGNORECASE,
)
"""Statements that neither move the robot nor touch frames, points or the way of the program."""

_SETTING: Final = (
    rb"\$(?:VEL|ACC|APO|ORI_TYPE|CIRC_TYPE|GEAR_JERK|JERK)(?:_\w+)?(?:\s*\[\s*\d+\s*\])?(?:\.\w+)?"
    rb"\s*=\s*(?:[+-]?\d+(?:\.\d*)?|[+-]?\.\d+|#\w+)\s*"
)
_CLAUSED: Final = re.compile(
    rb"\s*S?(?P<how>PTP|LIN|SPL|CIRC)\s*\{[^{}]*\}\s*(?P<end>,\s*\{[^{}]*\}\s*(?:,\s*CA\s*[-+\d.]+\s*)?)?"
    rb"(?:C_\w+\s*)*(?:WITH\s+" + _SETTING + rb"(?:,\s*" + _SETTING + rb")*)?",
    re.IGNORECASE,
)
"""A motion that the scanner leaves to the reader for clauses that change no frame."""
_HOW: Final = {b"PTP": INLINE_PTP, b"LIN": INLINE_LIN, b"SPL": INLINE_SPLINE, b"CIRC": INLINE_ARC}


_MOST_DIGITS: Final = 9
_NAME: Final = re.compile(rb"([^\"'\[]*+)(?:\[([\d \t]*+)\])?+([^\"'\[]*+)")
_ELEMENT: Final = re.compile(rb"\b(\w++)\s*+\[\s*+(\d++)\s*+\]")
_NO_POINT: Final = re.compile(
    rb"\$|\b(?:BASE_DATA|TOOL_DATA|LOAD_DATA|FDAT_ACT|PDAT_ACT|LDAT_ACT|FDAT|PDAT|LDAT|LOAD)\b",
    re.IGNORECASE,
)


class KrlSurvey(Survey):
    """One pass over a KRL file."""

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets)
        self._axes_at_rest = axes_at_rest
        self._external = ExternalAxes()

    @abstractmethod
    def _sort_scan(self, found: Scan) -> WindowLines | Whole:
        """Returns the lines of a window, or why they cannot be cut."""

    def _sort_lines(self, data: bytes) -> WindowLines | Whole:
        try:
            return self._sort_scan(scan(data, name=self.name))
        except FormatError as cause:
            line = None if cause.line is None else cause.line + self.lines
            raise FormatError(cause.message, source=self.name, line=line, hint=cause.hint) from None

    def _check_end(self) -> Whole | None:
        moves = self._external.away and not (self._axes_at_rest and self._external.steady)
        why = Whole(why="external axes are away from zero") if moves else None
        return super()._check_end() or why


class ExternalAxes:
    """Whether the external axes are away from zero, and the same at all targets so far."""

    def __init__(self) -> None:
        self._first: Array = np.empty((0, 6))
        self.away, self.steady = False, True

    def add(self, found: Scan, plain: BoolArray) -> None:
        """Looks at the targets of plain lines (l,)."""
        aggregates = np.flatnonzero(plain[found.agg_line])
        if not len(aggregates):
            return
        numbers, _, _ = target_numbers(found, aggregates)
        values = numbers.value[:, 8:] if numbers.value.shape[1] > 8 else np.full((1, 6), np.nan)
        self.away |= bool(np.nan_to_num(values).any())
        values = np.where(np.isnan(values), np.inf, values)
        self._first = self._first if len(self._first) else values[:1]
        self.steady &= bool((values == self._first).all())


class MotionSurvey(KrlSurvey):
    """One pass over a ``.src``."""

    events = "statements that may change frames or branch"

    def _sort_scan(self, found: Scan) -> WindowLines | Whole:
        found = with_clauses(found)
        targets, kind, is_axis = _motions(found)
        moves = kind != NOTHING
        self._external.add(found, moves)
        if (kind == MIXED).any():
            mixed = int(np.argmax(kind == MIXED))
            return Whole(why="an arc through axis values", line=self.lines + mixed + 1)
        event = np.zeros(len(kind), np.bool_)
        for line in np.flatnonzero(found.line_kind == STATEMENT).tolist():
            start, end = int(found.line_start[line]), int(found.line_end[line])
            event[line] = not _IDLE.fullmatch(found.data, start, end)
        return WindowLines(
            data=found.data,
            start=found.line_start.astype(np.int64),
            end=found.line_end.astype(np.int64),
            targets=targets,
            opens=np.asarray((kind == FULL) & (found.line_kind != INLINE_ARC)),
            partial=np.asarray(kind == PARTIAL),
            event=event,
            key=np.where(moves, is_axis.astype(np.int64), NO_KEY),
        )

    def _stand_in(self, lines: WindowLines, line: int) -> tuple[bytes, int]:
        return _AXIS_LINE if lines.key[line] else _POSE_LINE, 1


class PointSurvey(KrlSurvey):
    """One pass over a ``.dat``."""

    events = "statements that are no elements of arrays"
    stored = True

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets, axes_at_rest=axes_at_rest)
        self._shape: Shape | None = None
        self._count = 0

    def _sort_scan(self, found: Scan) -> WindowLines:
        plain, begins, self._shape = _point_lines(found, self._shape)
        self._external.add(found, plain)
        number = self._count + np.cumsum(begins)
        self._count = int(number[-1]) if len(number) else self._count
        return WindowLines(
            data=found.data,
            start=found.line_start.astype(np.int64),
            end=found.line_end.astype(np.int64),
            targets=plain.astype(np.int64),
            opens=plain,
            partial=np.zeros(len(plain), np.bool_),
            event=np.asarray((found.line_kind == STATEMENT) & ~plain),
            key=np.where(plain, number, NO_KEY),
        )

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the first and last point of every stretch cannot represent it, if so."""
        lines, spans = self.skeleton.split(b"\n"), defaultdict(list)
        for _, ends in groupby(self.shown, key=itemgetter(1)):
            elements = [_ELEMENT.search(lines[line]) for line, _ in ends]
            if elements[0] is not None:
                name = elements[0][1].lower()
                spans[name].append([int(element[2]) for element in elements if element])
        for name, numbers in spans.items():
            if any(one[-1] >= other[0] for one, other in pairwise(sorted(numbers))):
                return Whole(why=f"an element of {name.decode('latin-1')} is given twice")
        refused = super().judge(skeleton, others)
        if refused is not None:
            return refused
        for name in (name for name, numbers in spans.items() if max(map(len, numbers)) > 1):
            by_number = re.compile(rb"\b" + re.escape(name) + rb"\s*\[[\s\d,]*\]", re.IGNORECASE)
            if any(by_number.search(data) for _, data in others):
                return Whole(why=f"an element of {name.decode('latin-1')} is named by its number")
        return None


class Shape(NamedTuple):
    """What a point is called: all before it but its index, whether it is of axes, index or -1."""

    letters: bytes
    is_axis: bool
    number: int


def with_clauses(found: Scan) -> Scan:
    """Returns the scan with motions that state an angle or speeds as plain ones."""
    stated = found.line_kind[found.agg_line] == STATEMENT
    lines, count = np.unique(found.agg_line[stated], return_counts=True)
    if not len(lines):
        return found
    kind = np.array(found.line_kind)
    for line, aggregates in zip(lines.tolist(), count.tolist(), strict=True):
        code = _CLAUSED.fullmatch(
            found.data, int(found.line_start[line]), int(found.line_end[line])
        )
        arc = code is not None and code["how"].upper() == b"CIRC"
        if code and aggregates == 1 + arc and arc == (code["end"] is not None):
            kind[line] = _HOW[code["how"].upper()]
    return replace(found, line_kind=kind)


def _motions(found: Scan) -> tuple[IntArray, IntArray, BoolArray]:
    """Returns targets and kind of every line, and whether its first target has axis values."""
    pose, axis = count_parts(found)
    what = np.where(pose + axis == 6, FULL, PARTIAL)
    odd = (pose > 0) & (axis > 0) | (pose + axis == 0) | (found.agg_flag & NOT_CONSTANT > 0)
    what[odd] = ODD
    of_line = found.line_kind[found.agg_line]
    what[(of_line == INLINE_ARC) & (axis > 0)] = MIXED
    plain = np.flatnonzero(of_line > STATEMENT)
    lines, count = found.agg_line[plain], len(found.line_kind)
    kind, is_axis = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    np.maximum.at(kind, lines, what[plain])
    some, first = np.unique(lines, return_index=True)
    is_axis[some] = axis[plain[first]] > 0
    return np.bincount(lines, minlength=count), kind, is_axis


def as_motions(found: Scan) -> Scan:
    """Returns a scan in which only points of stretches are plain motions."""
    plain, _, _ = _point_lines(found, None)
    line_kind = np.where(plain, INLINE_LIN, EMPTY).astype(np.uint8)
    return replace(found, line_kind=line_kind)


def _point_lines(found: Scan, last: Shape | None) -> tuple[BoolArray, BoolArray, Shape | None]:
    """Returns which lines are plain points, where a stretch begins, and what the last was called.

    Args:
        found: Lines of a ``.dat``.
        last: What the point before them was called, None if a stretch cannot go on.
    """
    pose, axis = count_parts(found)
    whole = (pose + axis == 6) & ((pose == 0) | (axis == 0)) & (found.agg_flag == 0)
    first = first_aggregates(found)
    lines = np.flatnonzero(found.line_kind != EMPTY)
    plain, begins = np.zeros((2, len(found.line_kind)), np.bool_)
    if not len(whole):
        return plain, begins, None if len(lines) else last
    agg = np.minimum(first[lines], max(len(whole) - 1, 0))
    may = (found.line_kind[lines] == STATEMENT) & (np.diff(first)[lines] == 1)
    may[may] &= whole[agg[may]]
    places = np.column_stack(
        [found.line_start[lines], found.agg_open[agg], found.agg_close[agg], found.line_end[lines]]
    ).astype(np.int64)
    is_axis = np.asarray(axis[agg] > 0)
    follows, number = np.zeros(len(lines), np.bool_), np.full(len(lines), -1)
    _find_followers(np.frombuffer(found.data, np.uint8), may, is_axis, places, follows, number)
    columns = (lines, follows, number, may, is_axis)
    for k, (line, goes_along, index, one, of_axes) in enumerate(
        zip(*(column.tolist() for column in columns), strict=True)
    ):
        if last is not None and goes_along:
            plain[line], last = True, last._replace(number=index)
            continue
        shape = _read_shape(found.data, places[k], of_axes) if one else None
        goes_on = shape and last and shape[:2] == last[:2] and shape.number > max(last.number, -1)
        if shape is not None and not goes_on and _NO_POINT.search(shape.letters.partition(b"=")[0]):
            shape = None
        plain[line], begins[line] = shape is not None, shape is not None and not goes_on
        last = shape
    return plain, begins, last


@compile_kernel(PLAIN)
def _find_followers(
    buf: Bytes, may: BoolArray, is_axis: BoolArray, places: IntArray, follows: BoolArray,
    number: IntArray,
) -> None:  # fmt: skip
    """Marks points (n,) called as the one before but for a larger index; fills in the indices.

    A line with quotation marks, several brackets or no whole number in them is none of them. The
    names are compared letter by letter, upper and lower case alike.

    Args:
        buf: The file.
        may: (n,) lines with one whole aggregate.
        is_axis: (n,) it is one of axis values.
        places: (n, 4) first byte of each line, opening and closing brace, and end of the code.
        follows: (n,) written here.
        number: (n,) written here, -1 before.
    """
    was_left = was_right = -1
    for i in range(may.size):
        start, opened, closed, end = places[i]
        left = right = tail = -1
        digits, index, plain, given = 0, 0, may[i], False
        for k in range(start, opened if plain else start):
            c = buf[k]
            given |= c == 61
            if left < 0 or right >= 0:
                plain &= c != 34 and c != 39 and (c != 91 or left < 0)
                left = k if c == 91 else left
            elif c == 93:
                right = k
            elif 48 <= c <= 57:
                digits, index = digits + 1, min(10 * index + c - 48, 1 << 40)
            else:
                plain &= c == 32 or c == 9
        tail = closed + 1
        while tail < end and (buf[tail] == 32 or buf[tail] == 9):
            tail += 1
        plain &= given and right >= 0 and 1 <= digits <= _MOST_DIGITS
        plain &= tail >= end or buf[tail] == 44 or buf[tail] == 125
        if plain:
            number[i] = index
        same = plain and i > 0 and number[i - 1] >= 0 and index > number[i - 1]
        if same and is_axis[i] == is_axis[i - 1]:
            before = places[i - 1, 0]
            same = left - start == was_left - before
            same = same and opened - right == places[i - 1, 1] - was_right
            for k in range(left - start if same else 0):
                same &= _lower(buf[start + k]) == _lower(buf[before + k])
            for k in range(opened - right if same else 0):
                same &= _lower(buf[right + k]) == _lower(buf[was_right + k])
            follows[i] = same
        was_left, was_right = left, right


@compile_kernel(PLAIN)
def _lower(byte: int) -> int:
    """Returns a letter of a name in lower case."""
    return byte + 32 if 65 <= byte <= 90 else byte


def _read_shape(data: bytes, places: IntArray, is_axis: bool) -> Shape | None:
    """Returns what the point of a line is called; None if it is more, or part of a structure."""
    start, opened, closed, end = places.tolist()
    name = _NAME.fullmatch(data, start, opened)
    if name is None or data[closed + 1 : end].lstrip(b" \t")[:1] not in (b"", b",", b"}"):
        return None
    head, digits, tail = name.groups()
    letters = (head + tail if digits is None else head + b"[]" + tail).lower()
    if digits is None:
        return Shape(letters, is_axis, -1) if b"=" in letters else None
    digits = digits.translate(None, b" \t")
    if b"=" not in letters or not 1 <= len(digits) <= _MOST_DIGITS:
        return None
    return Shape(letters, is_axis, int(digits))


class KrlCutter:
    """Reads long ``.src`` and ``.dat`` files."""

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a ``.src`` or ``.dat``, not yet run, or why it cannot be cut."""
        if frames.external:
            return Whole(why="external axes in the kinematic chain need every target at once")
        if frames.fixed_tool:
            return Whole(why="a part on the robot is read whole")
        of_file = PointSurvey if name.lower().endswith(".dat") else MotionSurvey
        return of_file(name, targets, axes_at_rest=frames.external_axes_at_rest)

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines of a ``.src`` or ``.dat``."""
        frames = FrameTable(external_axes_at_rest=skeleton.external_axes_at_rest)
        name = skeleton.program.name
        found = scan(data, name=name)
        found = as_motions(found) if skeleton.stored else with_clauses(found)
        walk = KrlWalk([found], [name], Frames(frames, name))
        return ReadChunk(Builder(walk, 0, frames).program(0))


CUTTER: Final = KrlCutter()
