"""Reads the statements of a RAPID module in order: points, motions, tools, work objects."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats.course import Course
from robotrue.program.formats.number_table import NumberTable
from robotrue.program.formats.rapid_frames import KINDS, TOOL, WORK, RapidFrames
from robotrue.program.formats.rapid_moves import BUILT_IN, Move, Tail, move_of, read_tail
from robotrue.program.formats.rapid_scan import (
    JOINTTARGET,
    ROBTARGET,
    SKIP,
    Statement,
    clean,
    fills,
    statements,
)
from robotrue.program.formats.stored_points import Uses, Variable, Variables
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import Motion, Reason

LAYOUTS: Final = (tuple(range(17)), (*range(6), *range(11, 17)))
"""Columns of a robtarget (x y z, q1..q4, cf1 cf4 cf6 cfx, external axes) and of a jointtarget."""
POSE: Final = 0
AXIS: Final = 1
NOTHING: Final = 2
"""Kinds of points: the third stands for a motion to what is no literal."""
LITERAL: Final = {"robtarget": (ROBTARGET, POSE), "jointtarget": (JOINTTARGET, AXIS)}
SHIFTED: Final = "displacement"
AXES_SHIFTED: Final = "offset of external axes"
_SHIFTS: Final = {
    "pdispon": (SHIFTED, 1),
    "pdispset": (SHIFTED, 1),
    "pdispoff": (SHIFTED, 0),
    "eoffson": (AXES_SHIFTED, 1),
    "eoffsset": (AXES_SHIFTED, 1),
    "eoffsoff": (AXES_SHIFTED, 0),
}
_DECLARED: Final = re.compile(
    rb"(?:(?:LOCAL|TASK|GLOBAL)\s+)?(?:(?:CONST|PERS|VAR)\s+)"
    rb"(?P<kind>\w+)\s+(?P<name>\w+)\s*(?:\{(?P<sizes>[^}]*)\}\s*)?(?P<given>:=)?",
    re.IGNORECASE,
)
_ASSIGNED: Final = re.compile(rb"(\w+)\s*(?:\{([^}]*)\})?\s*((?:\.\s*\w+\s*)*):=")
_REFERENCE: Final = re.compile(r"(\w+)\s*(?:\{([^}]*)\})?$")
_SHIFTING: Final = re.compile(r"(offs|reltool)\s*\((.*)\)$", re.IGNORECASE | re.DOTALL)
_WORDS: Final = re.compile(rb'"(?:[^"\r\n]|"")*+"|![^\r\n]*+|(?<![\w.])([A-Za-z]\w*)')
_SIZE_OF: Final = re.compile(rb"\bDim\s*\(\s*\w+", re.IGNORECASE)
_PARAMETER: Final = re.compile(r"(?:INOUT|VAR|PERS|switch)?\s*\w+\s+(\w+)\s*(?:\{[^}]*\})?\s*$")
_READS_FRAMES: Final = re.compile(
    r"(?:move|trigg|search|arc|spot|paint|disp|cap|waitwobj|dropwobj|gripload|tp|err|egm)\w*$"
)
_COMPACT: Final = re.compile(
    rb'(?:"(?:[^"\r\n]|"")*+"|![^\r\n]*+|[^"!])*?\b((?:Move|Trigg|Search)\w+|\w+(?=\s*(?:\{[^}]*\}'
    rb"\s*)?(?:\.\s*\w+\s*)*:=)|GOTO|RETURN|EXIT)\b",
    re.IGNORECASE | re.DOTALL,
)


@dataclass(slots=True)
class Story:
    """What the walk collects.

    Attributes:
        offset: First byte of every point.
        row: Its row in the table of numbers, -1 if it has none.
        kind: ``POSE``, ``AXIS`` or ``NOTHING``.
        uses: What is moved to.
        settings: The (tool, work object) pairs motions name, and the byte that first does.
        flags: Reasons of points, found in the text.
        arcs: Pairs of points: via and end.
        based: Points that Offs or RelTool start from.
        notes: (byte, what to say).
        checks: ConfL and ConfJ that stop a check, and the byte of the first.
        begun: A module or motion was found.
    """

    offset: list[int] = field(default_factory=list)
    row: list[int] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)
    uses: Uses = field(default_factory=Uses)
    settings: dict[tuple[str, str], tuple[int, int]] = field(default_factory=dict)
    flags: dict[int, Reason] = field(default_factory=dict)
    arcs: list[tuple[int, int]] = field(default_factory=list)
    based: set[int] = field(default_factory=set)
    notes: list[tuple[int, str]] = field(default_factory=list)
    checks: dict[str, int] = field(default_factory=dict)
    begun: bool = False


class Walk:
    """One reading of a module, with frames from the files beside it."""

    def __init__(self, data: bytes, name: str, frames: RapidFrames, course: Course) -> None:
        self.data, self.name, self.frames, self.course = data, name, frames, course
        self.table = NumberTable(17, LAYOUTS)
        self.story, self.variables = Story(), Variables()
        self._at, self._scope, self._open, self._in_record = 0, "", 0, False
        self._tails: dict[tuple[bytes, int], Tail] = {}
        self._calls: list[str] = []
        self._routines: set[str] = set()

    def declarations(self) -> None:
        """Reads the tools and work objects only: a file beside the program."""
        for statement in statements(self.data, self.name):
            self._declare(statement, frames_only=True)

    def all(self) -> None:
        """Reads every statement."""
        for statement in statements(self.data, self.name):
            self._at += 1
            self._statement(statement)
        if self._open:
            raise FormatError(
                "the module has no ENDMODULE: the file is cut off.",
                source=self.name,
                line=line_at(self.data, len(self.data)),
                hint="export it again.",
            )

    def outside(self) -> list[str]:
        """Returns the instructions called that no file here holds and RAPID itself may not."""
        return list(dict.fromkeys(n for n in self._calls if n not in self._routines))

    def _statement(self, statement: Statement) -> None:
        word = statement.word
        move = move_of(word)
        if move is not None:
            self._move(statement.body, statement.end, move)
        elif word in _SHIFTS:
            self.course.set(self._at, *_SHIFTS[word])
            self._mention(statement.body, statement.end, word)
        elif not self._control(statement, word) and not self._declare(statement):
            if not self._assign(statement.start, statement.end):
                self._instruction(statement)

    def _instruction(self, statement: Statement) -> None:
        """What is neither motion nor assignment: an instruction, or a call of a routine."""
        start, end, word = statement.body, statement.end, statement.word
        self._mention(start, end, word)
        if word in ("confl", "confj"):
            said = " ".join(clean(self.data[statement.start : end]).split())
            if said.lower().endswith("off"):
                self.story.checks.setdefault(said, statement.start)
        if word not in BUILT_IN:
            self._calls.append(word)
            self.course.call(self._at, [word])
        for match in ROBTARGET.finditer(self.data, start, end):
            point = self._point(match.start(), self.table.add(match, POSE), POSE)
            self.story.flags[point] = Reason.EXPRESSION
            self.story.notes.append((match.start(), f"{word} is no motion that is followed"))

    def _control(self, statement: Statement, word: str) -> bool:
        """Follows branches, loops, jumps and routines; returns whether the word is one of them."""
        course, at = self.course, self._at
        if word in ("if then", "test"):
            course.branch(at, opens=word != "test")
        elif word in ("else", "elseif", "case", "default"):
            course.alternative(at, other=word in ("else", "default"))
        elif word in ("endif", "endtest"):
            course.join(at)
        elif word in ("for", "while"):
            course.loop(at)
        elif word in ("endfor", "endwhile"):
            course.close_loop(at)
        elif word in ("return", "exit"):
            course.leave(at)
        elif word == "goto":
            course.jump(at, self._text(statement).lower())
        elif word == "if":
            self._compact(statement)
            return True
        elif word == "label":
            course.label(at, self._text(statement).rstrip(":").strip().lower())
            return True
        else:
            return self._section(statement, word)
        self._mention(statement.body, statement.end, "")
        return True

    def _section(self, statement: Statement, word: str) -> bool:
        """Follows the parts a module is made of; returns whether the word is one of them."""
        if word in ("proc", "func", "trap"):
            self._routine(statement, word)
        elif word in ("endproc", "endfunc", "endtrap"):
            self._scope = ""
        elif word in ("error", "undo", "backward"):
            self.course.start(self._at, f"{self._scope} {word}", handler=True)
        elif word == "module":
            self._open, self.story.begun = self._open + 1, True
        elif word == "endmodule":
            self._open = max(0, self._open - 1)
        elif word in ("record", "endrecord"):
            self._in_record = word == "record"
        else:
            return word == "prefix" or self._in_record
        return True

    def _text(self, statement: Statement) -> str:
        return clean(self.data[statement.body : statement.end])

    def _routine(self, statement: Statement, word: str) -> None:
        before, _, parameters = self._text(statement).partition("(")
        names = before.split()
        self._scope = names[-1].lower() if names else ""
        self._routines.add(self._scope)
        self.course.start(self._at, self._scope, handler=word == "trap")
        for each in re.split(r"[,|\\]", parameters.rstrip(") ")):
            match = _PARAMETER.match(each.strip())
            if match:
                self.variables.declare(self._scope, match[1].lower(), "parameter").outside = True

    def _compact(self, statement: Statement) -> None:
        """``IF condition instruction;``: the instruction runs on one of two ways."""
        self.course.branch(self._at, opens=True)
        match = _COMPACT.match(self.data, statement.body, statement.end)
        self._at += 1
        if match is None:
            self._mention(statement.body, statement.end, "")
            self.course.call(self._at, re.findall(r"\w+", self._text(statement).lower()))
        else:
            start, body = match.start(1), match.end(1)
            self._mention(statement.body, start, "")
            self._statement(Statement(match[1].decode().lower(), start, body, statement.end))
        self._at += 1
        self.course.join(self._at)

    def _declare(self, statement: Statement, *, frames_only: bool = False) -> bool:
        if statement.word not in ("local", "task", "global", "const", "pers", "var"):
            return False
        match = _DECLARED.match(self.data, statement.start, statement.end)
        if match is None:
            return False
        kind, name = match["kind"].decode().lower(), match["name"].decode().lower()
        start, end = match.end(), statement.end
        if kind in KINDS and not match["sizes"]:
            value = self.data[start:end] if match["given"] else b""
            if not frames_only or not self.frames.has(KINDS[kind], name):
                self.frames.declare(KINDS[kind], name, value, self._line(statement.start))
        elif frames_only:
            return True
        elif kind in LITERAL:
            variable = self.variables.declare(self._scope, name, kind)
            variable.is_array = match["sizes"] is not None
            if match["given"]:
                self._give(variable, start, end)
        elif match["given"]:
            self._mention(start, end, "")
        return True

    def _give(self, variable: Variable, start: int, end: int, subscript: str = "") -> None:
        """Gives a variable the literal or, for an array, the literals between two bytes."""
        pattern, kind = LITERAL[variable.kind]
        if not variable.is_array or subscript:
            match = fills(pattern, self.data, *self._inside(start, end))
            if match is None:
                self._computed(variable, start, end)
            else:
                self._point_of(variable, subscript, match, kind)
            return
        at, number, matches = start, [0], []
        for match in pattern.finditer(self.data, start, end):
            between = clean(self.data[at : match.start()])
            number = _counted(number, between)
            if re.sub(r"[\[\],\s]", "", between):
                self._computed(variable, start, end)
                return
            matches.append((",".join(map(str, number)), match))
            at = match.end()
        if re.sub(r"[\]\s]", "", clean(self.data[at:end])) or not matches:
            self._computed(variable, start, end)
            return
        for subscript, match in matches:
            self._point_of(variable, subscript, match, kind)

    def _inside(self, start: int, end: int) -> tuple[int, int]:
        gap = SKIP.match(self.data, start, end)
        return (gap.end() if gap else start), end

    def _computed(self, variable: Variable, start: int, end: int) -> None:
        variable.computed = True
        self._mention(start, end, "")

    def _point_of(
        self, variable: Variable, subscript: str, match: re.Match[bytes], kind: int
    ) -> None:
        point = self._point(match.start(), self.table.add(match, kind), kind)
        variable.give(subscript, point, self.course.barriers)

    def _point(self, offset: int, row: int, kind: int) -> int:
        story = self.story
        story.offset.append(offset)
        story.row.append(row)
        story.kind.append(kind)
        return len(story.offset) - 1

    def _assign(self, start: int, end: int) -> bool:
        match = _ASSIGNED.match(self.data, start, end)
        if match is None:
            return False
        name, path = match[1].decode().lower(), match[3].decode()
        for side in (TOOL, WORK):
            if self.frames.has(side, name):
                value = self.data[match.end() : end]
                if match[2]:
                    self.frames.lose(side, name, self._at)
                else:
                    self.frames.assign(side, name, path, value, self._at)
                return True
        variable = self.variables.find(self._scope, name)
        if variable is None or variable.kind not in LITERAL:
            self._mention(match.end(), end, "")
        else:
            subscript = re.sub(rb"\s+", b"", match[2] or b"").decode()
            plain = bool(re.fullmatch(r"\d*(,\d+)*", subscript)) and not path.strip()
            if plain and bool(subscript) == variable.is_array:
                self._give(variable, *self._inside(match.end(), end), subscript)
            else:
                self._computed(variable, match.end(), end)
        return True

    def _mention(self, start: int, end: int, word: str) -> None:
        """Marks what takes part in something that is not followed."""
        text = _SIZE_OF.sub(b"", self.data[start:end])
        if not text or text.isspace():
            return
        for match in _WORDS.finditer(text):
            if not match[1]:
                continue
            name = match[1].decode().lower()
            variable = self.variables.find(self._scope, name)
            if variable is not None:
                variable.computed = True
            elif word and not _READS_FRAMES.match(word):
                for side in (TOOL, WORK):
                    if self.frames.has(side, name):
                        self.frames.lose(side, name, self._at)

    def _move(self, start: int, end: int, move: Move) -> None:
        self.story.begun = True
        gap = SKIP.match(self.data, start, end)
        first = gap.end() if gap else start
        pattern = JOINTTARGET if move.axes else ROBTARGET
        match = pattern.match(self.data, first, end) if move.targets == 1 else None
        tail_at = match.end() if match else start
        key = self.data[tail_at:end] if match else None
        if match is not None and key is not None:
            tail = self._tails.get((key, move.tool))
            if tail is None:
                tail = read_tail(self.data, tail_at, end, move, given=1)
                if tail is not None and not tail.places:
                    self._tails[key, move.tool] = tail
            if tail is not None and not tail.places:
                kind = AXIS if move.axes else POSE
                point = self._point(match.start(), self.table.add(match, kind), kind)
                self._use(point, move.motion, tail, start)
                return
        tail = read_tail(self.data, start, end, move, given=0)
        if tail is None:
            raise FormatError(
                "the brackets of this motion do not match, or its ';' is missing.",
                source=self.name,
                line=line_at(self.data, start),
                hint="the file may be cut off or edited by hand; export it again.",
            )
        used = []
        for number, (a, b) in enumerate(tail.places):
            how = Motion.ARC_VIA if move.targets == 2 and number == 0 else move.motion
            points = self._target(a, b, move)
            used.append(points)
            for point in points:
                self._use(point, how, tail, start)
        if len(used) == 2:
            self._pair(*used)

    def _pair(self, via: list[int], last: list[int]) -> None:
        if len(via) == len(last):
            self.story.arcs += zip(via, last, strict=True)
        else:
            self.story.arcs += [(a, b) for a in via for b in last]

    def _use(self, point: int, motion: int, tail: Tail, start: int) -> None:
        settings = self.story.settings
        key = tail.tool, tail.work
        if any(self._is_parameter(name) for name in key):
            key = (f"{tail.tool} ({self._scope})", f"{tail.work} ({self._scope})")
        number, _ = settings.setdefault(key, (len(settings), start))
        self.story.uses.add(point, self._at, motion, number)

    def _is_parameter(self, name: str) -> bool:
        variable = self.variables.find(self._scope, name)
        return variable is not None and variable.outside

    def _target(self, start: int, end: int, move: Move) -> list[int]:
        """Returns the points a target argument may mean; one of no numbers if none is known."""
        kind = "jointtarget" if move.axes else "robtarget"
        pattern, code = LITERAL[kind]
        match = fills(pattern, self.data, start, end)
        if match:
            return [self._point(start, self.table.add(match, code), code)]
        text = clean(self.data[start:end])
        named = _REFERENCE.match(text)
        if named:
            variable = self.variables.find(self._scope, named[1].lower())
            subscript: str | None = re.sub(r"\s+", "", named[2] or "")
            if subscript and not re.fullmatch(r"\d+(,\d+)*", subscript):
                subscript = None
            if variable is not None and variable.kind == kind:
                points = self.variables.points_at(variable, subscript, self.course.barriers)
                if points:
                    return points
            why = (
                "is a parameter or is computed"
                if variable is not None
                else "is in no file of this program"
            )
            return [self._lost(start, Reason.EXPRESSION, f"the target {text[:40]!r} {why}")]
        shifting = _SHIFTING.match(text)
        if shifting:
            self._based(shifting[2])
            return [self._lost(start, Reason.RELATIVE, f"{shifting[1]} starts from another target")]
        self._mention(start, end, "")
        return [self._lost(start, Reason.EXPRESSION, f"the target {text[:40]!r} is computed")]

    def _based(self, inside: str) -> None:
        named = _REFERENCE.match(inside.split(",")[0].strip())
        variable = self.variables.find(self._scope, named[1].lower()) if named else None
        if variable is None:
            return
        for point in self.variables.points_at(variable, None, self.course.barriers):
            self.story.based.add(point)

    def _lost(self, offset: int, reason: Reason, what: str) -> int:
        point = self._point(offset, -1, NOTHING)
        self.story.flags[point] = reason
        self.story.notes.append((offset, what))
        return point

    def _line(self, offset: int) -> int:
        return line_at(self.data, offset) - 1


def _counted(number: list[int], between: str) -> list[int]:
    """Returns the subscript of the next element of an array literal from what lies before it."""
    opened = between.count("[")
    if number == [0]:
        return [1] * max(1, opened)
    closed = between.count("]")
    keep = number[: max(1, len(number) - closed)]
    keep[-1] += 1
    return keep + [1] * opened
