"""Long programs whose moves name numbered points of another section: Fanuc LS and Yaskawa JBI.

The skeleton has all lines but plain points and plain moves to them. Of those it has the first point
of each state and motion, and the first and last move between other statements, with their points. A
block is read by the ordinary reader in its place in the skeleton, with one move to each of its
plain points. The lines before and after the points are blocks without targets.
"""

from __future__ import annotations

import re
import sys
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.alike import Alike
from robotrue.program.formats.file_survey import NO_KEY, PlacedSurvey, Survey, WindowLines
from robotrue.program.formats.splice_chunks import read_between
from robotrue.program.formats.text_lines import line_edges
from robotrue.program.program import FrameTable, Motion, Program
from robotrue.program.program_chunk import (
    ChunkLines,
    PointMoves,
    ReadChunk,
    Skeleton,
    Splice,
    Whole,
)

OTHER, MOVES, POINTS = -1, -2, -3
"""Kinds of sections; ``OTHER`` also of what is no plain point or move."""
_BLANK: Final = re.compile(rb"\s*+")
_NAMES: Final = 2_000_000
"""Points have numbers below."""
_STATE: Final = 8
"""More than there are motions."""


class Part(NamedTuple):
    """Points or moves that are alike, or something else.

    Attributes:
        state: Number of the state of points, :class:`Motion` of moves, ``OTHER``.
        is_point: It is a point.
        opens: A block may begin with it.
        header: Lines before the one of the target.
        first: Added to the numbers in the text.
        names: (k,) numbers of the points; all points that something else names.
        place: (k, 2) first byte and end of each.
        blank: Line ends before the text of each.
    """

    state: int = OTHER
    is_point: bool = False
    opens: bool = False
    header: int = 0
    first: int = 0
    names: IntArray = np.zeros(0, np.int64)
    place: IntArray = np.zeros((1, 2), np.int64)
    blank: int = 0

    def lines(self, edges: IntArray) -> tuple[IntArray, IntArray]:
        """Returns first and last line (k,) of each in lines with some edges."""
        first = np.searchsorted(edges, self.place[:, 0], side="right") - 1 + self.blank
        return first, np.searchsorted(edges, self.place[:, 1] - 1, side="right") - 1


class NumberedSurvey(PlacedSurvey):
    """Two passes over a file: its points and their uses, then the skeleton."""

    events = "lines that are no plain points and moves to them"
    sections: ClassVar[tuple[tuple[re.Pattern[bytes], int, int, tuple[int, ...]], ...]]
    """Lines after which the sections begin in turn, their kinds, and in what :meth:`_match_plain`
    finds there the groups of the number and of other numbers."""

    def __init__(self, name: str, targets: int, frames: FrameTable) -> None:
        super().__init__(name, targets, frames)
        self._use = np.full(_NAMES, int(Motion.UNUSED), np.int8)
        self._shown = np.zeros(_NAMES, np.bool_)
        self._rank = np.full(_NAMES, -1, np.int32)  # line of the point with a number
        self._disorder = 0  # line of a point that is moved to after a later one
        self._points: list[IntArray] = []  # line, name and state of each plain point
        self._before: IntArray | None = None  # last move, if nothing else follows it
        self._plain = [np.zeros(0, np.int64)]  # lines of plain points in the skeleton
        self._moves = np.zeros((0, 3), np.int64)
        self._range = [0, sys.maxsize]  # lines with points
        self._borders: list[int] = []
        self._begin()

    def _begin(self) -> None:
        """Begins a pass."""
        self.lines = self._section = 0
        self._inside, self._last_rank = False, -1

    @abstractmethod
    def _match_plain(self, data: bytes, at: int, end: int) -> tuple[re.Match[bytes], Part] | None:
        """Returns a plain point or move that begins at a byte."""

    @abstractmethod
    def _match_other(self, data: bytes, at: int, end: int) -> tuple[int, Part | None]:
        """Returns the end of what else begins at a byte, and its part if it is no comment."""

    @abstractmethod
    def _find_fault(self, skeleton: Program) -> str:
        """Returns why a skeleton cannot represent the file; nothing if it can."""

    @property
    def kind(self) -> int:
        """Kind of the section of the last part."""
        return self.sections[self._section - 1][1] if self._section else OTHER

    def _find_parts(self, data: bytes) -> Iterator[Part]:
        """Yields the parts of a window."""
        at = 0
        while at < len(data):
            coming = self.sections[self._section :]
            head = find_line(coming[0][0], data, at) if coming else None
            end = head[0] if head else len(data)
            yield from self._find_between(data, at, end)
            at = end
            if head:
                at = head[1]
                yield Part(place=np.array([head]))
                self._section += 1

    def _find_between(self, data: bytes, at: int, end: int) -> Iterator[Part]:
        """Yields the parts of a section, or of a piece of one."""
        if self.kind == OTHER:
            if at < end:
                yield Part(place=np.array([[at, end]]))
            return
        _, _, group, zones = self.sections[self._section - 1]
        alike = Alike(data, (group,), zones)
        while at < end:
            found, begin = self._match_plain(data, at, end), at
            if found is None:
                at, other = self._match_other(data, at, end)
                if other is not None:
                    blank = _count_blank_lines(data, begin, at)
                    yield other._replace(place=np.array([[begin, at]]), blank=blank)
                continue
            match, part = found
            part, at = part._replace(blank=_count_blank_lines(data, at, end)), match.end()
            names = np.array([int(match[group]) + part.first])
            yield part._replace(place=np.array([match.span()]), names=names)
            for rows in alike.after(match, end):
                at = int(rows[-1, 1])
                yield part._replace(place=rows[:, :2], names=rows[:, 2] + part.first)

    def run(self, path: Path, beside: Sequence[Path] = ()) -> Whole | None:
        """Goes through a file; returns why it cannot be cut, if so."""
        refused = self._go_through(path, self._note_window)
        if refused is not None:
            return refused
        line, name, state = np.concatenate([np.zeros((3, 0), np.int64), *self._points], axis=1)
        plain = ~self._shown[name]
        table = np.column_stack([line, name, self._use[name]])[plain]
        _, first = np.unique(_STATE * state[plain] + table[:, 2], return_index=True)
        self._shown[table[first, 1]] = True
        self._shown |= (self._use != Motion.UNUSED) & (self._rank < 0)
        self._moves = table[~self._shown[table[:, 1]] & (table[:, 2] != Motion.UNUSED)]
        self._points.clear()
        self._begin()
        return super().run(path)

    def _note_window(self, data: bytes) -> Whole | None:
        """Notes the points of a window and their uses."""
        edges, before = line_edges(data), -1
        if data.count(b"\r") != data.count(b"\r\n"):
            return Whole(why="a line ends with a carriage return alone", line=self.lines + 1)
        for part in self._find_parts(data):
            first, last = part.lines(edges)
            shared = np.append(before, last[:-1]) >= first
            before, names = int(last[-1]), part.names
            if shared.any():
                line = self.lines + int(first[np.argmax(shared)]) + 1
                return Whole(why="a second statement or point in a line", line=line)
            if part.is_point:
                if (self._rank[names] >= 0).any() or len(np.unique(names)) < len(names):
                    return Whole(why="a point is given twice", line=self.lines + int(first[0]) + 1)
                self._rank[names] = self.lines + first
            if part.state == OTHER:
                self._shown[names] = True
            elif part.is_point:
                state = np.full(len(names), part.state)
                self._points.append(np.stack([self.lines + first + part.header, names, state]))
            if not part.is_point:
                self._note_use(part)
        self.lines += len(edges) - 1
        return None

    def _note_use(self, part: Part) -> None:
        """Notes moves, or another statement, which ends a stretch of them."""
        if part.state == OTHER:
            if self._before is not None:
                self._shown[self._before] = True
            self._before = None
            return
        if self._before is None:
            self._shown[part.names[:1]] = True
        self._before = part.names[-1:]
        fresh = (self._use[part.names] == Motion.UNUSED) | (part.state == Motion.PTP)
        self._use[part.names[fresh]] = part.state

    def _sort_lines(self, data: bytes) -> WindowLines:
        edges = line_edges(data)
        targets, depth = np.zeros((2, len(edges)), np.int64)
        opens, self._borders = np.zeros(len(edges) - 1, np.bool_), [0] * (not self._inside)
        for part in self._find_parts(data):
            first, last = part.lines(edges)
            if (self.kind == POINTS) != self._inside:
                self._inside = not self._inside
                self._borders.append(int(first[0]))
                self._range[not self._inside] = self.lines + int(first[0])
            plain = part.state != OTHER
            if not part.is_point:
                self._compare_order(part)
            shown = self._shown[part.names] if plain else np.ones(1, np.bool_)
            depth[first[shown]] += 1
            depth[last[shown] + 1] -= 1
            if part.is_point and plain:
                rows = first + part.header
                targets[rows], opens[first] = 1, part.opens
                self._plain.append(self.lines + rows[shown])
        event = np.cumsum(depth[:-1]) > 0
        return WindowLines(
            data=data, start=edges[:-1], end=edges[1:], targets=targets[:-1], opens=opens,
            partial=np.zeros_like(event), event=event, key=np.full(len(event), NO_KEY),
        )  # fmt: skip

    def _compare_order(self, part: Part) -> None:
        """Finds moves that do not go to points in their order; others are in the skeleton."""
        rank = np.append(self._last_rank, self._rank[part.names] if part.state != OTHER else -1)
        odd = np.diff(rank) <= 0
        if part.state != OTHER and odd.any() and not self._disorder:
            self._disorder = int(rank[1:][odd][0]) + 1
        self._last_rank = int(rank[-1])

    def _cut(self, lines: WindowLines) -> None:
        super()._cut(lines)
        for row in self._borders:
            place = self.size + int(lines.start[row]), self.lines + row
            if place not in [(byte, line) for byte, line, _ in self._cuts]:
                self._cuts.append((*place, self.targets + int(lines.targets[:row].sum())))
                self._leads.append(place)
        pairs = sorted(zip(self._cuts, self._leads, strict=True))
        self._cuts, self._leads = [cut for cut, _ in pairs], [lead for _, lead in pairs]

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the file cannot be cut, if so; counts the points that are not plain."""
        fault, plain = self._find_fault(skeleton), np.concatenate(self._plain)
        other = np.setdiff1d(skeleton.line - 1, plain)
        if fault or len(skeleton) != len(plain) + len(other):
            return Whole(why=fault or "the targets of its lines are not certain")
        if self._disorder or (np.diff(skeleton.path[:, 1], prepend=-1) <= 0).any():
            why = "moves go to points in another order than that of the points"
            return Whole(why=why, line=self._disorder)
        self._add_targets(other)
        return None

    def splice(self) -> Splice:
        """Returns the text that chunks are read together with."""
        first, end = self._range
        return replace(super().splice(), moves=PointMoves(first, end, self._moves))


def find_line(pattern: re.Pattern[bytes], data: bytes, at: int) -> tuple[int, int] | None:
    """Returns begin and end of the first line from a byte on that a pattern finds after blanks."""
    for match in pattern.finditer(data, at):
        begin = data.rfind(b"\n", 0, match.start()) + 1
        if not data[begin : match.start()].strip(b" \t"):
            return begin, match.end()
    return None


def _count_blank_lines(data: bytes, at: int, end: int) -> int:
    """Returns the number of line ends in the blanks from a byte on."""
    text = _BLANK.match(data, at, end)
    return text[0].count(b"\n") if text else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberedCutter:
    """Reads the long files of a language of numbered points.

    Attributes:
        survey: Makes the survey of a file from its name, the targets of a chunk and the frames.
        add_moves: Returns the text before and after points with moves to numbers by one motion.
        take: Returns some rows of the spans of a program.
    """

    survey: Callable[[str, int, FrameTable], NumberedSurvey]
    add_moves: Callable[[bytes, bytes, Sequence[int], Motion], tuple[bytes, bytes]]
    take: Callable[[Any, slice], object]

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a file of this name, not yet run, or why it cannot be cut."""
        if frames.external:
            return Whole(why="external axes in the kinematic chain need every target at once")
        return self.survey(name, targets, frames)

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines; their data are in their place in the skeleton."""
        part, whole = skeleton.splice, skeleton.program
        if part is None or part.moves is None:
            raise FormatError("the file was outlined for another language.", source=whole.name)
        if not part.moves.first <= lines.line < part.moves.end:
            program, _ = read_between(part.text, b"", b"", lines, whole, part.frames)
            return ReadChunk(self._take(program, slice(0), data, 0))
        edge = [lines.line, lines.line + len(line_edges(data)) - 1]
        first, last = np.searchsorted(part.line, edge).tolist()
        head, foot = part.text[: part.edge[first]], part.text[part.edge[last] :]
        moves = part.moves.table[slice(*np.searchsorted(part.moves.table[:, 0], edge).tolist())]
        for how in np.unique(moves[:, 2]).tolist():
            names = moves[moves[:, 2] == how, 1].tolist()
            head, foot = self.add_moves(head, foot, names, Motion(how))
        program, rows = read_between(head, data, foot, lines, whole, part.frames)
        own = self._take(program, rows, program.data, head.count(b"\n"))
        return ReadChunk(own, len(head), len(foot))

    def _take(self, program: Program, rows: slice, data: bytes, before: int) -> Program:
        """Returns consecutive targets of a program that begin after so many lines."""
        own, path = program.take(rows), np.zeros((0, 3), np.int64)
        spans = self.take(program.spans, rows)
        return replace(own, data=data, line=own.line - before, path=path, spans=spans)
