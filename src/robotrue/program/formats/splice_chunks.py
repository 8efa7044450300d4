"""Long programs of points as words: G-code, Heidenhain, APT and CSV.

A chunk is read by the ordinary reader of the language, in its place in the skeleton of the file:
all statements that may matter to points, and the first point of each stretch between them. A chunk
begins with a straight move that states all of its words, so that no word, arc or reason crosses its
border; before it the modes in force there are set, such as G1, and after it follows the first move
of the next chunk.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import FormatError
from robotrue.program.carried import carried_sides
from robotrue.program.formats.file_survey import (
    LEAD,
    LONGEST_CHUNK,
    NO_KEY,
    PlacedSurvey,
    Survey,
    WindowLines,
)
from robotrue.program.formats.path_words import Turn, take_words, tool_axes
from robotrue.program.formats.text_lines import line_edges
from robotrue.program.lang import find_language
from robotrue.program.line_note import cut_note, join_notes
from robotrue.program.orientation import CarriedFrame, OrientationRule
from robotrue.program.program import FrameTable, Program
from robotrue.program.program_chunk import (
    ChunkLines,
    ReadChunk,
    Skeleton,
    Splice,
    SpliceStart,
    Whole,
)

NO_TURN, ANGLES, VECTOR = 0, 1, 2
"""Words for the orientation in a line."""
_TURNS: Final = {
    NO_TURN: (Turn.FIXED,), ANGLES: (Turn.FIXED, Turn.ANGLES), VECTOR: (Turn.VECTOR,),
}  # fmt: skip
"""Orientation of the first point of a stretch, by the words of a line that begins a chunk."""
_NO_START: Final = SpliceStart(b"", b"", np.eye(3)[[0, 2]])
_FIRST: Final = 64
"""Points at the begin of a file that the skeleton has all of: they determine its style."""


class PointLines(NamedTuple):
    """The l lines of a window.

    Attributes:
        start: (l,) first byte of each line.
        end: (l,) byte after the last of its statement.
        targets: (l,) number of targets of a plain point, else 0.
        event: (l,) it may matter to points after it, or is one that is not plain.
        turn: (l,) words for the orientation.
        full: (l,) a straight move that leaves no coordinate out, and of the orientation all or
            none.
        mode: (l,) what is in force after it, such as the number of G0 or G1.
        axis: (l, 3) tool axis that its words state, as printed, NaN where they state none.
    """

    start: IntArray
    end: IntArray
    targets: IntArray
    event: BoolArray
    turn: IntArray
    full: BoolArray
    mode: IntArray
    axis: Array


class SpliceSurvey(PlacedSurvey):
    """One pass over a file."""

    events = "lines that are no plain points"

    def __init__(self, name: str, targets: int, frames: FrameTable) -> None:
        super().__init__(name, targets, frames)
        self._points = self._turn = 0
        self._goes_on = False
        self._mode = self._shown_mode = 0
        self._now = np.zeros((3, 0), np.int64)  # mode before and after each line, and its turn
        self._carried = np.zeros((0, 2, 3))  # x of the carried frame and tool axis before lines
        self._last_carried = np.eye(3)[[0, 2]]
        self._recent: dict[int, SpliceStart] = {}
        self._axes: dict[int, Array] = {}
        self._starts: dict[int, SpliceStart] = {}
        self._turns: dict[int, int] = {}

    @abstractmethod
    def _sort_points(self, data: bytes) -> PointLines:
        """Returns the lines of a window."""

    def _print_mode(self, mode: int) -> bytes:
        """Returns the line that sets a mode."""
        return b""

    def _one_line(self, code: bytes) -> bytes:
        """Returns the code of a point in one line."""
        return code

    def _sort_lines(self, data: bytes) -> WindowLines:
        found = self._sort_points(data)
        number = self._points + np.cumsum(found.targets > 0)
        event = found.event | ((found.targets > 0) & (number <= _FIRST))
        point = np.asarray((found.targets > 0) & ~event)
        rows = np.arange(len(event))
        last = np.maximum.accumulate(np.where(found.turn != NO_TURN, rows, -1))
        turn = np.where(last >= 0, found.turn[last], self._turn)
        marks = np.flatnonzero(event | point)
        follows = np.zeros(len(event), np.bool_)
        follows[marks] = np.concatenate([[self._goes_on], point[marks]])[:-1]
        self._now = np.stack([np.append(self._mode, found.mode)[:-1], found.mode, found.turn])
        self._carry(found.axis)
        if len(event):
            self._points, self._turn = int(number[-1]), int(turn[-1])
            self._mode = int(found.mode[-1])
        self._goes_on = bool(point[marks[-1]]) if len(marks) else self._goes_on
        return WindowLines(
            data=data, start=found.start, end=found.end, targets=np.where(point, found.targets, 0),
            opens=point & follows & found.full & (found.turn == turn),
            partial=np.zeros_like(event), event=event, key=np.where(point, 0, NO_KEY),
        )  # fmt: skip

    def _carry(self, axis: Array) -> None:
        """Carries the frame along the tool axes of a window."""
        axis = tool_axes(axis)
        mine = np.flatnonzero(np.isfinite(axis).all(axis=1))
        carried = np.empty((len(axis) + 1, 2, 3))
        carried[0] = self._last_carried
        place = np.zeros(len(axis) + 1, np.int64)
        if len(mine):
            carried[mine + 1, 0] = carried_sides(axis[mine], *self._last_carried)
            carried[mine + 1, 1] = axis[mine]
            place[mine + 1] = mine + 1
        self._carried = carried[np.maximum.accumulate(place)]
        self._last_carried = self._carried[-1].copy()

    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        before, after, _ = self._now[:, line].tolist()
        if before != self._shown_mode:
            self._write(self.lines + line, self._print_mode(before)[:-1], 0)
        super()._begin_stretch(lines, line)
        self._shown_mode = after

    def _write(self, line: int, code: bytes, targets: int) -> None:
        super()._write(line, self._one_line(code), targets)
        self._axes[line] = self._carried[line - self.lines + 1, 1].copy()

    def _cut(self, lines: WindowLines) -> None:
        known, may = len(self._cuts), np.flatnonzero(lines.opens)
        super()._cut(lines)
        for (_, line, _), (_, lead) in zip(self._cuts[known:], self._leads[known:], strict=True):
            row = line - self.lines
            self._turns[line] = int(self._now[2, row])
            code = self._one_line(lines.code(row)) + b"\n"
            self._starts[line] = self._start(row)._replace(point=code)
            if lead and lead not in self._starts:
                recent = lead < self.lines
                self._starts[lead] = (
                    self._recent[lead] if recent else self._start(lead - self.lines)
                )
        fresh = {row + self.lines: self._start(row) for row in may[-4 * LEAD :].tolist()}
        self._recent = dict(list((self._recent | fresh).items())[-4 * LEAD :])

    def _start(self, row: int) -> SpliceStart:
        """Returns what is in force at a line of the window."""
        mode = self._print_mode(int(self._now[1, row]))
        return SpliceStart(mode, b"", self._carried[row].copy())

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the file cannot be cut, if so; counts the targets that are not plain.

        Chunks that would begin where words are inherited or inserted in another way go to those
        before them.
        """
        at, shown = skeleton.line - 1, np.array([line for line, _ in self.shown], np.int64)
        plain = np.isin(at, shown)
        if not np.array_equal(at[plain], shown):
            return Whole(why="the targets of its lines are not certain")
        other, words = at[~plain], skeleton.spans
        odd = self._find_axis(skeleton)
        if odd:
            return Whole(why="a tool axis that is not stated by a plain point", line=odd)
        row = np.searchsorted(at, [line for _, line, _ in self._cuts], side="right") - 1
        kept = [0]
        for k in range(1, len(self._cuts)):
            turn = int(words.turn[row[k]]) in _TURNS[self._turns[self._cuts[k][1]]]
            if turn and (words.at[row[k]] >= 0 or (words.at < 0).all()):
                kept.append(k)
        self._leads = [self._leads[k] for k in kept]
        self._cuts = [self._cuts[k] for k in kept]
        self._add_targets(other)
        before = np.array([*(count for _, _, count in self._cuts), self.targets])
        longest = int(np.argmax(np.diff(before)))
        if before[longest + 1] - before[longest] > LONGEST_CHUNK * self._asked:
            why = f"{before[longest + 1] - before[longest]} targets after it without a complete one"
            return Whole(why=why, line=self._cuts[longest][1] + 1)
        return None

    def _find_axis(self, skeleton: Program) -> int:
        """Returns the line of a target whose tool axis was read otherwise here; 0 without one."""
        words = skeleton.spans
        stated = (words.turn == Turn.VECTOR) & (words.numbers.start[:, 3:] >= 0).any(axis=1)
        axis = tool_axes(words.value[:, 3:])
        own = np.array([self._axes[line] for line in (skeleton.line - 1).tolist()]).reshape(-1, 3)
        own[words.turn == Turn.FIXED] = (0.0, 0.0, 1.0)
        odd = (stated | (words.turn == Turn.FIXED)) & np.isfinite(axis).all(axis=1)
        odd &= (axis != own).any(axis=1)
        return int(skeleton.line[np.argmax(odd)]) if odd.any() else 0

    def splice(self) -> Splice:
        """Returns the text that chunks are read together with."""
        return replace(super().splice(), starts=self._starts)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpliceCutter:
    """Reads the long files of a language of words.

    Attributes:
        survey: Makes the survey of a file from its name, the targets of a chunk and the frames.
    """

    survey: Callable[[str, int, FrameTable], SpliceSurvey]

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a file of this name, not yet run."""
        return self.survey(name, targets, frames)

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines; their data are in their place in the skeleton."""
        part, whole = skeleton.splice, skeleton.program
        if part is None:
            raise FormatError("the file was outlined for another language.", source=whole.name)
        count = len(line_edges(data)) - 1
        first, last = np.searchsorted(part.line, [lines.line, lines.line + count]).tolist()
        start, after = (part.starts.get(at, _NO_START) for at in (lines.line, lines.line + count))
        head = part.text[: part.edge[first]] + start.mode
        foot = after.mode + after.point + part.text[part.edge[last] :]
        before = head.count(b"\n")
        carried = CarriedFrame(before + 1, *start.carried)
        frames = replace(part.frames, orientation=replace(part.frames.orientation, carried=carried))
        program, rows = read_between(head, data, foot, lines, whole, frames)
        own = _take_targets(program, rows, before)
        if after.point and not _ends_at(own, frames.orientation, after):
            raise FormatError(
                "a tool axis in these lines is read in another way than in the whole.",
                source=whole.name, line=lines.line + 1, hint="split the program before them.",
            )  # fmt: skip
        noted = [cut_note(each, before, count, lines.line - before) for each in program.noted]
        return ReadChunk(replace(own, noted=join_notes(noted)), len(head), len(foot))


def read_between(
    head: bytes, data: bytes, foot: bytes, lines: ChunkLines, whole: Program, frames: FrameTable
) -> tuple[Program, slice]:
    """Returns the program of some lines between others, and the rows of its targets in them.

    Raises:
        FormatError: They cannot be read, with the line in the file.
    """
    before, count = head.count(b"\n"), len(line_edges(data)) - 1
    text = head + data + foot
    try:
        program = find_language(whole.dialect).read(text, name=whole.name, frames=frames)
    except FormatError as cause:
        line = None if cause.line is None else cause.line - before + lines.line
        raise FormatError(cause.message, source=whole.name, line=line, hint=cause.hint) from None
    if not np.array_equal(program.T_flange_tool, whole.T_flange_tool, equal_nan=True):
        raise FormatError("the file changed since it was outlined.", source=whole.name)
    return program, slice(*np.searchsorted(program.line - 1, [before, before + count]).tolist())


def _ends_at(program: Program, rule: OrientationRule, after: SpliceStart) -> bool:
    """Returns whether the frame carried along the last tool axes is that of the next chunk."""
    carried = np.isin(program.spans.turn, (Turn.VECTOR, Turn.FIXED))
    rows = np.flatnonzero(carried & np.isfinite(program.rotation).all(axis=(1, 2)))
    if not len(rows):
        return True
    rule = replace(rule, carried=CarriedFrame(0, *after.carried))
    frame = rule.rotations(after.carried[1:])[0]
    return bool(np.allclose(program.rotation[rows[-1]], frame, rtol=0.0, atol=1e-9))


def _take_targets(program: Program, rows: slice, before: int) -> Program:
    """Returns consecutive targets of a program that begin after so many lines."""
    part = program.take(rows)
    path = program.path[rows] - [rows.start, rows.start, 0] if len(program.path) else program.path
    return replace(part, line=part.line - before, path=path, spans=take_words(program.spans, rows))
