"""The points, tools and work objects a RAPID module keeps in data."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from robotrue.program.formats import rapid_scan as scan
from robotrue.program.formats.number_table import NumberTable
from robotrue.program.formats.rapid_beside import CallsBeside, RapidRoutine, RoutineReader
from robotrue.program.formats.rapid_expression import PURE
from robotrue.program.formats.rapid_flow import RapidFlow
from robotrue.program.formats.rapid_frames import KINDS, TOOL, WORK, RapidFrames
from robotrue.program.formats.rapid_moves import READING
from robotrue.program.formats.rapid_values import KINDS as FOLLOWED
from robotrue.program.formats.rapid_values import RapidChange, RapidTask, RapidValues
from robotrue.program.formats.stored_points import ParsedPoints, Variable, Variables
from robotrue.program.formats.text_lines import line_starts

LAYOUTS: Final = (tuple(range(17)), (*range(6), *range(11, 17)))
"""Columns of a robtarget (x y z, q1..q4, cf1 cf4 cf6 cfx, external axes) and of a jointtarget."""
POSE: Final = 0
AXIS: Final = 1
NOTHING: Final = 2
"""Third kind of points: the target of a motion that is not a literal."""
LITERAL: Final = {"robtarget": (scan.ROBTARGET, POSE), "jointtarget": (scan.JOINTTARGET, AXIS)}
_DECLARED: Final = re.compile(
    rb"(?:(?:LOCAL|TASK|GLOBAL)\b" + scan.GAP + rb")?(?:CONST|PERS|VAR)\b" + scan.GAP
    + rb"(?P<kind>[\w\x80-\xff]+)" + scan.GAP + rb"(?P<name>[\w\x80-\xff]+)" + scan.GAP
    + rb"(?:\{(?P<sizes>[^}]*)\}" + scan.GAP + rb")?(?P<given>:=)?",
    re.IGNORECASE,
)  # fmt: skip
_ASSIGNED: Final = re.compile(
    rb"([\w\x80-\xff]+)"
    + scan.GAP
    + rb"(?:\{([^}]*)\})?"
    + scan.GAP
    + rb"((?:\."
    + scan.GAP
    + scan.WORD
    + scan.GAP
    + rb")*+):="
)
_WORDS: Final = re.compile(
    rb'"(?:[^"\r\n]|"")*+"|![^\r\n]*+|(?<![\w\x80-\xff.])([A-Za-z\x80-\xff][\w\x80-\xff]*)'
)
_SIZE_OF: Final = re.compile(rb"\bDim\s*\(\s*[\w\x80-\xff]+", re.IGNORECASE)
_HANDED: Final = re.compile(rb"(?<![\w\x80-\xff])([\w\x80-\xff]++)\s*+\(([^()]*+)\)")
_READS_FRAMES: Final = re.compile(
    r"(?:move|trigg|search|arc|spot|paint|disp|cap|pdisp|eoffs|waitwobj|dropwobj|gripload|tp|err|egm)"
    r"[\w\x80-\xff]*$"
)


@dataclass(slots=True)
class ParsedRapid(ParsedPoints):
    """Results of the walk; kinds are ``POSE``, ``AXIS`` and ``NOTHING``.

    Attributes:
        settings: The (tool, work object) pairs motions name, and the byte that first does.
        based: Points that Offs or RelTool start from.
        written: Points that are written out: the bytes they take the place of, and their numbers.
        bases: Points they are computed from; themselves where other modules hold one.
        displaced: (place, routine, text of the displacement) by the version of ``SHIFTED`` it sets.
        checks: ConfL and ConfJ that stop a check, and the byte of the first.
        begun: A module or motion was found.
    """

    settings: dict[tuple[str, str], tuple[int, int]] = field(default_factory=dict)
    based: set[int] = field(default_factory=set)
    checks: dict[str, int] = field(default_factory=dict)
    written: dict[int, tuple[int, int, tuple[float, ...]]] = field(default_factory=dict)
    bases: dict[int, list[int]] = field(default_factory=dict)
    displaced: dict[int, tuple[int, str, str]] = field(default_factory=dict)
    begun: bool = False


class SharedData(NamedTuple):
    """What the other modules of a task have to know of one.

    Attributes:
        frames: Tools and work objects: side, name, value, line, no other module can change it.
        targets: Names of the targets that others may use.
        routines: By name.
    """

    frames: tuple[tuple[str, str, bytes, int, bool], ...]
    targets: tuple[str, ...]
    routines: dict[str, RapidRoutine]


def read_shared_data(data: bytes, name: str) -> SharedData:
    """Returns what other modules have to know of one.

    Raises:
        FormatError: A statement of it does not end.
    """
    frames, targets, starts = [], [], line_starts(data)
    reader = RoutineReader(data)
    statement, at = scan.next_statement(data, scan.beginning(data), name)
    while statement is not None:
        match, word = _match_declaration(data, statement), statement.word
        kind = _lower(match["kind"]) if match else ""
        reader.take(statement)
        if match and word == "local":
            pass  # other modules cannot see it
        elif match and kind in KINDS and not match["sizes"]:
            value = data[match.end() : statement.end] if match["given"] else b""
            line = int(np.searchsorted(starts, statement.start, side="right")) - 1
            frames.append((KINDS[kind], _lower(match["name"]), value, line, word == "const"))
        elif match and kind in LITERAL:
            targets.append(_lower(match["name"]))
        statement, at = scan.next_statement(data, at, name)
    return SharedData(tuple(frames), tuple(targets), reader.routines)


def _match_declaration(data: bytes, statement: scan.RapidStatement) -> re.Match[bytes] | None:
    """Returns the parts of a declaration up to its value; None if the statement is none."""
    if statement.word not in ("local", "task", "global", "const", "pers", "var"):
        return None
    return _DECLARED.match(data, statement.start, statement.end)


def _lower(name: bytes) -> str:
    return name.decode("latin-1").lower()


class RapidSource(NamedTuple):
    """A module to be read, and what is known of its task: other modules and their frames."""

    data: bytes
    name: str
    frames: RapidFrames
    course: RapidFlow
    task: RapidTask
    beside: CallsBeside


class Data:
    """Values of declarations and assignments while a module is read.

    Attributes:
        data: The bytes.
        name: File name.
        frames: Tools and work objects.
        course: The ways through the program.
        beside: What the routines of other modules do.
        table: Numbers of the points.
        story: What the walk collects.
        variables: Points by name.
        values: Of numbers, positions and targets.
        derived: Data set from other data: variable, routine, and the bytes of the new value.
        read: Variables that are read by what is not followed.
        place: Number of the statement being read.
        scope: Routine being read, empty outside of all.
    """

    def __init__(self, source: RapidSource) -> None:
        self.data, self.name, self.frames, self.course, task, self.beside = source
        self.values = RapidValues(self.course, task, self.name)
        self.derived: list[tuple[tuple[str, str], str, int, int]] = []
        self.read: set[tuple[str, str]] = set()
        self.table = NumberTable(self.data, LAYOUTS, b"!")
        self.story, self.variables = ParsedRapid(), Variables()
        self.place, self.scope = 0, ""
        self._starts = line_starts(self.data)

    def declare(self, statement: scan.RapidStatement) -> bool:
        """Enters a declaration; returns whether the statement is one."""
        match = _match_declaration(self.data, statement)
        if match is None:
            return False
        kind, name = _lower(match["kind"]), _lower(match["name"])
        start, end = match.end(), statement.end
        if kind in FOLLOWED:
            text = scan.clean(self.data[start:end]) if match["given"] else None
            self.values.declare(self.scope, name, text, local=statement.word == "local")
        if kind in KINDS and not match["sizes"]:
            value = self.data[start:end] if match["given"] else b""
            self.frames.declare(KINDS[kind], name, value, self._line(statement.start))
            if self.scope or statement.word in ("local", "const"):
                self.frames.own.add((KINDS[kind], name))
        elif kind in LITERAL:
            variable = self.variables.declare(self.scope, name, kind)
            variable.is_array = match["sizes"] is not None
            if not self.scope and statement.word != "local":  # moved to elsewhere, in other frames
                variable.computed |= self.values.task.is_read_outside(name, self.name)
            if match["given"]:
                self._give(variable, start, end)
        elif match["given"] and kind in FOLLOWED:
            self.derived.append((self.values.key(self.scope, name), self.scope, start, end))
        elif match["given"]:
            self.mention(start, end, "")
        return True

    def _give(self, variable: Variable, start: int, end: int, subscript: str = "") -> None:
        """Gives a variable the literal or, for an array, the literals between two bytes."""
        pattern, kind = LITERAL[variable.kind]
        if not variable.is_array or subscript:
            match = scan.fills(pattern, self.data, *self._inside(start, end))
            if match is None:
                variable.computed = True
            else:
                self._point_of(variable, subscript, match, kind)
            return
        at, number, matches = start, [0], []
        for match in pattern.finditer(self.data, start, end):
            between = scan.clean(self.data[at : match.start()])
            number = _count_subscript(number, between)
            if re.sub(r"[\[\],\s]", "", between):
                self._mark_computed(variable, start, end)
                return
            matches.append((",".join(map(str, number)), match))
            at = match.end()
        if re.sub(r"[\]\s]", "", scan.clean(self.data[at:end])) or not matches:
            self._mark_computed(variable, start, end)
            return
        for subscript, match in matches:
            self._point_of(variable, subscript, match, kind)

    def _inside(self, start: int, end: int) -> tuple[int, int]:
        gap = scan.SKIP.match(self.data, start, end)
        return (gap.end() if gap else start), end

    def _mark_computed(self, variable: Variable, start: int, end: int) -> None:
        variable.computed = True
        self.mention(start, end, "")

    def _point_of(
        self, variable: Variable, subscript: str, match: re.Match[bytes], kind: int
    ) -> None:
        point = self.story.add(match.start(), self.table.add(*match.span(), kind), kind)
        variable.give(subscript, point, self.course.barriers)

    def assign(self, start: int, end: int) -> bool:
        """Enters ``name := value``; returns whether the statement is one."""
        match = _ASSIGNED.match(self.data, start, end)
        if match is None:
            return False
        name, path = match[1].decode("latin-1").lower(), scan.clean(match[3])
        for side in (TOOL, WORK):
            if self.frames.has(side, name):
                value = self.data[match.end() : end]
                if match[2]:
                    self.frames.lose(side, name, self.place)
                else:
                    self.frames.assign(side, name, path, value, self.place)
                return True
        variable = self.variables.find(self.scope, name)
        subscript = re.sub(rb"\s+", b"", match[2] or b"").decode("latin-1")
        text = scan.clean(self.data[match.end() : end])
        change = RapidChange(self.place, subscript, path.strip().strip("."), text)
        self.values.change(self.scope, name, change)
        if self.values.knows(self.scope, name):
            key = self.values.key(self.scope, name)
            self.derived.append((key, self.scope, match.end(), end))
        else:
            self.mention(match.end(), end, "")
        if variable is not None and variable.kind in LITERAL:
            plain = bool(re.fullmatch(r"\d*(,\d+)*", subscript)) and not path.strip()
            if plain and bool(subscript) == variable.is_array:
                self._give(variable, *self._inside(match.end(), end), subscript)
            else:
                variable.computed = True
        return True

    def mention(self, start: int, end: int, word: str) -> None:
        """Marks the names in a construct that is not followed, with its instruction if any."""
        text = _SIZE_OF.sub(b"", self.data[start:end])
        if not text or text.isspace():
            return
        self._hand_over(text, word)
        for match in _WORDS.finditer(text):
            if not match[1]:
                continue
            name = match[1].decode("latin-1").lower()
            variable = self.variables.find(self.scope, name)
            self.read.add(self.values.key(self.scope, name))
            if variable is not None:
                variable.computed = True
            elif word and not _READS_FRAMES.match(word):
                for side in (TOOL, WORK):
                    if self.frames.has(side, name):
                        self.frames.lose(side, name, self.place)

    def _hand_over(self, text: bytes, word: str) -> None:
        """Forgets the values of what routines and instructions may change."""
        names: list[bytes] = []
        if word and word not in READING:
            names = [match[1] for match in _WORDS.finditer(text) if match[1]]
        for function, inside in _HANDED.findall(text):
            if function.decode("latin-1").lower() not in PURE:
                names += [match[1] for match in _WORDS.finditer(inside) if match[1]]
        for name in names:
            lower = name.decode("latin-1").lower()
            if self.values.knows(self.scope, lower):
                self.values.change(self.scope, lower, RapidChange(self.place, "", "", None))

    def follow_derived(self) -> None:
        """Marks names whose values depend on marked ones, over any number of steps."""
        waiting, scope = self.derived, self.scope
        while True:
            fresh = [each for each in waiting if self._is_read(each[0])]
            if not fresh:
                break
            waiting = [each for each in waiting if not self._is_read(each[0])]
            for _, self.scope, start, end in fresh:
                self.mention(start, end, "")
        self.scope = scope

    def _is_read(self, key: tuple[str, str]) -> bool:
        if key in self.read:
            return True
        local = self.values.is_local(*key)
        return not local and self.values.task.is_read_outside(key[1], self.name)

    def _line(self, offset: int) -> int:
        return int(np.searchsorted(self._starts, offset, side="right")) - 1


def _count_subscript(number: list[int], between: str) -> list[int]:
    """Returns the subscript of the next element of an array literal from what lies before it."""
    opened = between.count("[")
    if number == [0]:
        return [1] * max(1, opened)
    closed = between.count("]")
    keep = number[: max(1, len(number) - closed)]
    keep[-1] += 1
    return keep + [1] * opened
