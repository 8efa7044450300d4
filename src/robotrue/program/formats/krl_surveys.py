"""What surveys of KRL files share, and that of stored points: elements of arrays in a ``.dat``.

A stretch of points is assignments to elements of one array, ``name[k]={X ..}`` with nothing left
out, by growing ``k``. In the skeleton its first and last line stand for it; whatever the program
does with an element it chose by a computed number it does with all of them. An array with an
element that a file names by a written number is not surveyed.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.file_survey import Survey, WindowLines, reason_column
from robotrue.program.formats.krl_columns import count_parts, target_numbers
from robotrue.program.formats.krl_operands import first_aggregates
from robotrue.program.formats.krl_scan import EMPTY, INLINE_LIN, STATEMENT, Scan, scan
from robotrue.program.program import Motion, Program
from robotrue.program.program_chunk import Whole

_MOST_DIGITS: Final = 9
_NAME: Final = re.compile(rb"([^\"'\[]*+)(?:\[([\d \t]*+)\])?+([^\"'\[]*+)")
_ELEMENT: Final = re.compile(rb"\b(\w++)\s*+\[\s*+(\d++)\s*+\]")
_NO_POINT: Final = re.compile(
    rb"\$|\b(?:BASE_DATA|TOOL_DATA|LOAD_DATA|FDAT_ACT|PDAT_ACT|LDAT_ACT|FDAT|PDAT|LDAT|LOAD)\b",
    re.IGNORECASE,
)


def line_edges(found: Scan) -> tuple[IntArray, IntArray]:
    """Returns the first byte of every line (l,), and the byte after its code (l,)."""
    return found.line_start.astype(np.int64), found.line_end.astype(np.int64)


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


class Shape(NamedTuple):
    """What a point is called: all before it but its index, whether it is of axes, index or -1."""

    letters: bytes
    is_axis: bool
    number: int


class PointSurvey(KrlSurvey):
    """One pass over a ``.dat``."""

    events = "statements that are no elements of arrays"

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets, axes_at_rest=axes_at_rest)
        self._shape: Shape | None = None
        self._plain: BoolArray = np.zeros(0, np.bool_)
        self._tail: tuple[int, bytes] | None = None  # last line of the stretch that is open
        self._spans: dict[bytes, list[tuple[int, int, bool]]] = defaultdict(list)
        self._element: tuple[bytes, int] | None = None

    def _sort_scan(self, found: Scan) -> WindowLines:
        plain, begins, self._shape = _point_lines(found, self._shape)
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
    columns = (may, found.line_start[lines], found.agg_open[agg], found.agg_close[agg],
               found.line_end[lines], axis[agg] > 0)  # fmt: skip
    for line, one, *place in zip(lines.tolist(), *(each.tolist() for each in columns), strict=True):
        shape = _read_shape(found.data, *place) if one else None
        goes_on = shape and last and shape[:2] == last[:2] and shape.number > max(last.number, -1)
        if shape is not None and not goes_on and _NO_POINT.search(shape.letters.partition(b"=")[0]):
            shape = None
        plain[line], begins[line] = shape is not None, shape is not None and not goes_on
        last = shape
    return plain, begins, last


def _read_shape(
    data: bytes, start: int, opened: int, closed: int, end: int, is_axis: bool
) -> Shape | None:
    """Returns what the point of a line is called; None if it is more, or part of a structure."""
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
