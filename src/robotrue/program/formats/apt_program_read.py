"""Reads APT and CL data with the bytes of its points."""

from __future__ import annotations

import re
from array import array
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.formats.apt import LENGTHS, UNREAD_MOTIONS
from robotrue.program.formats.apt_modal import AxisSystems
from robotrue.program.formats.apt_statements import (
    LARGEST,
    AptStatement,
    is_number,
    statements,
    to_number,
)
from robotrue.program.formats.gcode_arcs import no_arcs
from robotrue.program.formats.number_table import Numbers, NumberTable
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.path_tools import find_named_tools
from robotrue.program.formats.path_words import PathWords, Turn, poses, tool_axes
from robotrue.program.formats.shared_fate import share_fate
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NUMBER: Final = re.compile(WHOLE_NUMBER)
_CELL: Final = rb"[ \t]*+[+-]?(?:\d++(?:\.\d*+)?|\.\d++)[ \t]*+"
_THREE: Final = b",".join([_CELL] * 3)
_PLAIN: Final = re.compile(
    rb"^[ \t]*+GOTO[ \t]*+/(" + _THREE + rb"(?:," + _THREE + rb")?)(?=\r?$)",
    re.IGNORECASE | re.MULTILINE,
)
"""A line that is nothing but a point of three or six numbers."""
_ONE: Final = (b"", b"", b"", b",", b",", b",")
_ARCS: Final = ("MOVARC", "NURBS")
_UP: Final = (0.0, 0.0, 1.0)
_MODES: Final = {"CYCLE": "a cycle moves at every point", "CUTCOM": "moved sideways by CUTCOM/"}


def read_apt_program(data: bytes, name: str, frames: FrameTable) -> Program:
    """Returns the program of APT or CL data.

    Raises:
        FormatError: Not text, a statement that cannot be read, a continuation without an end, or
            no point at all; with the line.
    """
    require_text(data, name)
    plain = _plain_points(data)
    reader = _Reader(data, name)
    done = 0
    for statement in statements(plain.rest, name):
        upto = int(np.searchsorted(plain.line, statement.line))
        reader.points(plain, slice(done, upto))
        done = upto
        reader.take(statement)
    reader.points(plain, slice(done, len(plain.line)))
    return reader.program(frames)


class _Points(NamedTuple):
    """Lines that are nothing but a point, and the file with a blank in place of each."""

    line: IntArray
    start: IntArray
    length: IntArray
    value: Array
    rest: bytes


def _plain_points(data: bytes) -> _Points:
    """Reads the lines that are nothing but a point and neither continue one nor are continued."""
    table, begins, ends, last = NumberTable(data, [range(6)], b"$"), array("q"), array("q"), -9
    for match in _PLAIN.finditer(data):
        begin, end = match.span()
        # After another point there is nothing but a line end.
        if begin - last <= len(b"\r\n") or not is_continued(data, begin):
            begins.append(begin)
            ends.append(end)
            table.add(*match.span(1), 0)
        last = end
    numbers, place = table.numbers(), np.array([begins, ends], np.int64)
    fits = ~((numbers.start >= 0) & ~(np.abs(numbers.value) <= LARGEST)).any(axis=1)
    numbers, place = numbers.rows(np.flatnonzero(fits)), place[:, fits]
    line = np.searchsorted(line_starts(data), place[0], side="right")
    pieces, last = [], 0
    for begin, end in place.T.tolist():
        pieces.append(data[last:begin])
        last = end
    rest = b" ".join([*pieces, data[last:]])
    return _Points(line, numbers.start, numbers.length, numbers.value, rest)


def is_continued(data: bytes, begin: int) -> bool:
    """Returns whether the line before a byte that begins one ends with a dollar sign."""
    return data[data.rfind(b"\n", 0, max(begin - 1, 0)) + 1 : begin].rstrip().endswith(b"$")


class _Part(NamedTuple):
    """Rows that follow each other."""

    line: IntArray
    start: IntArray
    length: IntArray
    value: Array
    turn: IntArray
    unit: Array
    reason: IntArray
    tool: IntArray
    locked: BoolArray


class _Reader:
    def __init__(self, data: bytes, name: str) -> None:
        self.data, self.name = data, name
        self.starts: IntArray = line_starts(data)
        self.unit, self.told_unit = MM, False
        self.axis: tuple[float, ...] = _UP
        self.by_axis = self.locked = False
        self.systems = AxisSystems(name)
        self.lost: str = ""
        self.relative = False
        self.modes: dict[str, str] = {}
        self.arc = False
        self.tools: dict[str, int] = {}
        self.tool = 0
        self.count = 0
        self.parts: list[_Part] = []
        self.groups: list[list[int]] = []
        self.told: list[tuple[int, str]] = []

    def take(self, statement: AptStatement) -> None:
        """Takes one statement."""
        if statement.comment:
            self._system(statement)
        head, arguments = statement.head, statement.arguments
        word = head.partition(",")[0].partition(" ")[0]
        if head == "GOTO":
            self._goto(statement)
        elif head in ("FROM", "GODLTA"):
            if len(arguments) == 6 and all(map(is_number, arguments[3:])):
                self.axis = tuple(map(to_number, arguments[3:]))
                self.by_axis = True
            if head == "GODLTA":
                self._row(statement, [], Reason.RELATIVE, "GODLTA/ is a step")
        elif head == "MULTAX":
            self.locked = arguments[:1] == ("OFF",)
        elif head == "UNITS":
            self._units(statement)
        elif head == "TLAXIS":
            self._tlaxis(arguments)
        elif head == "CIRCLE":
            self.arc = True
        elif head == "TLON,GOFWD":
            self.arc = True
            self._row(statement, [], Reason.EXPRESSION, "an arc")
        elif head == "MSYS":
            self._axes(statement)
        elif head in ("LOADTL", "TOOLNO"):
            self.tool = self.tools.setdefault(
                arguments[0] if arguments else "", len(self.tools) + 1
            )
        elif word in _MODES:
            self.modes.pop(word, None)
            if arguments[:1] not in (("OFF",), ("NOMORE",)):
                self.modes[word] = _MODES[word]
        elif word == "MODE" and "INCR" in arguments:
            self.relative = True
        elif word in UNREAD_MOTIONS:
            self.arc = self.arc or word in _ARCS  # its start makes another arc, too
            self._lose(f"{word} in line {statement.line} {UNREAD_MOTIONS[word]}")

    def _lose(self, why: str) -> None:
        self.lost = self.lost or why

    def _system(self, statement: AptStatement) -> None:
        try:
            self.systems.comment(statement.comment, statement.line, points=bool(self.count))
        except FormatError as error:
            self._lose(f"line {statement.line}: {error.message.rstrip('.')}")

    def _axes(self, statement: AptStatement) -> None:
        if not all(map(is_number, statement.arguments)):
            self._lose(f"line {statement.line}: MSYS/ is not read")
            return
        try:
            values = tuple(to_number(each) for each in statement.arguments)
            self.systems.take(values, statement.line, points=bool(self.count))
        except FormatError as error:
            self._lose(f"line {statement.line}: {error.message.rstrip('.')}")

    def _units(self, statement: AptStatement) -> None:
        word = statement.arguments[0] if statement.arguments else ""
        if word not in LENGTHS:
            raise FormatError(
                f"UNITS/{word}, expected MM or INCHES.",
                source=self.name,
                line=statement.line,
                hint="post the path in one of them.",
            )
        self.unit, self.told_unit = LENGTHS[word], True

    def _tlaxis(self, arguments: tuple[str, ...]) -> None:
        if len(arguments) == 3 and all(map(is_number, arguments)):
            i, j, k = (to_number(each) for each in arguments)
            self.axis = (i, j, k)
        else:
            self._lose("TLAXIS/ is not three numbers")

    def _goto(self, statement: AptStatement) -> None:
        count = len(statement.arguments)
        if count not in (3, 6) or not all(map(is_number, statement.arguments)):
            self._row(statement, [], Reason.EXPRESSION, "GOTO/ with other than 3 or 6 numbers")
            return
        spans = self._spans(statement.line, count)
        if spans is None:
            self._row(statement, [], Reason.EXPRESSION, "a number of a form that is not rewritten")
            return
        self._row(statement, spans, *self._state())

    def _spans(self, line: int, count: int) -> list[tuple[int, int, float]] | None:
        """Returns (first byte, bytes, value) of the numbers of a statement, over its lines."""
        found: list[tuple[int, int, float]] = []
        at = self.data.index(b"/", int(self.starts[line - 1])) + 1
        while len(found) < count and line <= len(self.starts):
            last = int(self.starts[line]) if line < len(self.starts) else len(self.data)
            end = self.data.find(b"$", at, last)
            end = last if end < 0 else end
            for cell in re.finditer(rb"[^,\r\n]+", self.data[at:end]):
                token = cell[0].strip()
                if not token:
                    continue
                if not _NUMBER.fullmatch(token) or not abs(float(token)) <= LARGEST:
                    return None
                lead = len(cell[0]) - len(cell[0].lstrip())
                found.append((at + cell.start() + lead, len(token), float(token)))
            at, line = last, line + 1
        return found if len(found) == count else None

    def points(self, found: _Points, part: slice) -> None:
        """Reads lines that are points, without other statements between them."""
        if part.stop <= part.start:
            return
        value = np.array(found.value[part])
        axis = np.where(np.isnan(value[:, 3:]), np.nan, value[:, 3:])
        given = np.asarray(~np.isnan(axis).any(axis=1))
        last = np.maximum.accumulate(np.where(given, np.arange(len(value)), -1))
        value[:, 3:] = np.where((last >= 0)[:, None], axis[last], np.array(self.axis))
        spoken = (last >= 0) | self.by_axis
        reason, what = self._state()
        if what:
            self.told += [(int(self.starts[n - 1]), what) for n in found.line[part].tolist()]
        reasons = np.full(len(value), int(reason))
        if self.arc:
            reasons[0] = self._end_arc(found.line[part.start])
        self._enter(found.line[part], found.start[part], found.length[part], value, spoken, reasons)
        self.axis = (value[-1, 3], value[-1, 4], value[-1, 5])
        self.by_axis = bool(spoken[-1])

    def _state(self) -> tuple[Reason, str]:
        """Why points here cannot be compensated, and the text of each note."""
        if self.relative:
            return Reason.RELATIVE, "MODE/INCR makes coordinates add up"
        if self.modes:
            return Reason.EXPRESSION, next(iter(self.modes.values()))
        return (Reason.UNKNOWN_FRAME if self.lost else Reason.NONE), ""

    def _end_arc(self, line: int) -> Reason:
        """Half a corrected arc is another arc: its start is held back with it."""
        self.arc = False
        if self.count:
            self.groups.append([self.count - 1, self.count])
        self.told.append((int(self.starts[line - 1]), "an arc"))
        return Reason.EXPRESSION

    def _row(
        self,
        statement: AptStatement,
        spans: list[tuple[int, int, float]],
        reason: Reason,
        what: str,
    ) -> None:
        """Adds a point that is more than a plain line."""
        if len(spans) == 6:
            self.axis = (spans[3][2], spans[4][2], spans[5][2])
            self.by_axis = True
        if what:
            self.told.append((int(self.starts[statement.line - 1]), what))
        if self.arc:
            reason = self._end_arc(statement.line)
        table = np.array([*spans, *[(-1, 0, np.nan)] * (6 - len(spans))])
        value = table[:, 2].copy()
        value[3:] = self.axis
        self._enter(
            np.array([statement.line]), table[None, :, 0].astype(np.int64),
            table[None, :, 1].astype(np.int64), value[None], np.array([self.by_axis]),
            np.array([int(reason)]),
        )  # fmt: skip

    def _enter(
        self,
        line: IntArray,
        start: IntArray,
        length: IntArray,
        value: Array,
        by_axis: BoolArray,
        reason: IntArray,
    ) -> None:
        n = len(line)
        if self.locked:  # an axis here is to be the one that is locked: it keeps its numbers
            start = start.copy()
            start[:, 3:] = -1
        turn = np.where(by_axis, int(Turn.VECTOR), int(Turn.FIXED))
        unit, tool = np.full(n, self.unit), np.full(n, self.tool)
        locked = np.full(n, self.locked)
        self.parts.append(_Part(line, start, length, value, turn, unit, reason, tool, locked))
        self.count += n

    def program(self, frames: FrameTable) -> Program:
        """Returns the program."""
        if not self.count:
            raise FormatError(
                "no GOTO/: the file has no point.", source=self.name, line=1,
                hint="output CL data (APT source) from the CAM system.",
            )  # fmt: skip
        line, start, length, value, turn, unit, reason, of_tool, locked = (
            np.concatenate(each) for each in zip(*self.parts, strict=True)
        )
        n, notes = len(line), TargetNotes(self.name, line)
        fixed = turn == Turn.FIXED
        value[fixed, 3:] = tool_axes(value[fixed, 3:])
        position, rotation, axes = poses(value, unit, turn, frames.orientation, line)
        names = {number: called for called, number in self.tools.items()}
        tool, tools = find_named_tools(frames, of_tool, names, reason, notes)
        self._close(frames, reason, position, rotation, notes)
        share_fate(reason, self.groups)
        self._tell(notes)
        printed = np.where(start >= 0, value, np.nan)
        at = np.where(start[:, 2] >= 0, (start + length).max(axis=1), -1)
        at[reason == Reason.RELATIVE] = -1
        return Program(
            name=self.name, dialect="apt", data=self.data, position=position, rotation=rotation,
            axes=axes, motion=np.full(n, int(Motion.LIN)), reason=reason,
            words=np.empty((n, 0), np.int64), words_of="", line=line,
            frame=np.zeros(n, np.int64), tool=tool,
            T_base_frame=np.asarray(frames.T_base_frame)[None], T_flange_tool=tools,
            notes=notes.notes(), noted=notes.on_lines(),
            spans=PathWords(
                numbers=Numbers(start=start, length=length, value=printed),
                value=value, unit=unit, turn=turn, skip=np.zeros(n, np.bool_), at=at,
                barred=locked[:, None] & (np.arange(6) > 2), names=(_ONE,) * 4, blank=False,
                rule=frames.orientation, arcs=no_arcs(), marks=np.empty((n, 0, 2), np.int64),
            ),
        )  # fmt: skip

    def _close(
        self,
        frames: FrameTable,
        reason: IntArray,
        position: Array,
        rotation: Array,
        notes: TargetNotes,
    ) -> None:
        """Closes rows whose pose is not known."""
        unknown = ~np.isfinite(position).all(axis=1) & (reason == Reason.NONE)
        turned = ~np.isfinite(rotation).all(axis=(1, 2)) & (reason == Reason.NONE)
        reason[unknown | turned] = Reason.INCOMPLETE
        if turned.any() and frames.orientation.spin is None:
            notes.rows(
                turned, "only the tool axis is stated: state [controller] spin_deg in the cell"
            )
        elif turned.any():
            notes.rows(turned, "a tool axis not of length 1")

    def _tell(self, notes: TargetNotes) -> None:
        if not self.told_unit:
            notes.say(f"{self.name}:1: the file does not state UNITS/: millimetres are assumed.")
        if self.systems.own:
            notes.say(
                f"{self.name}:{self.systems.own}: the points are in a machining axis system; that "
                "is the work frame."
            )
        if self.lost:
            notes.say(f"{self.name}: {self.lost}; points behind it are not compensated.")
        notes.each(self.told, self.starts)
