"""Reads the statements of a RAPID module in order: points, motions, tools, work objects."""

from __future__ import annotations

import re
from collections.abc import Container
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats import rapid_scan as scan
from robotrue.program.formats.course import Course
from robotrue.program.formats.rapid_data import LITERAL, NOTHING, POSE, Data
from robotrue.program.formats.rapid_frames import TOOL, WORK, RapidFrames
from robotrue.program.formats.rapid_moves import BUILT_IN, Move, Tail, move_of, read_tail
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import Motion, Reason

_TAILS: Final = 4096
"""Kept ways a motion goes on behind its literal; nearly all of a post's are the same few."""
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
FOREIGN: Final = "routine in no file"
"""Since it ran nothing has put again what it may have changed: this, and a key of ``_SHIFTS`` or
(side, name) of tools and work objects."""
_BY_NAME: Final = "a call by name"
_ROUTINE: Final = re.compile(rb"(?im)^[ \t]*PROC[ \t]+([\w\x80-\xff]+)")
_CHANGES: Final = re.compile(
    rb"(?i)\b(?:PDisp|EOffs)(?:On|Set)\b|\b[uot]frame\b[^:;]*:=|"
    rb"^[ \t]*(?:t|tool|w|wobj)[\w\x80-\xff]*[ \t]*:=|%",
    re.MULTILINE,
)
"""What a module holds that may change a displacement, a tool or a work object, or call anything."""
_TOKEN: Final = re.compile(r'"(?:[^"]|"")*"|[\w\x80-\xff]+|\S')
_OPERATORS: Final = frozenset("and or xor not div mod".split())
_REFERENCE: Final = re.compile(r"([\w\x80-\xff]+)\s*(?:\{([^}]*)\})?$")
_SHIFTING: Final = re.compile(r"(offs|reltool)\s*\((.*)\)$", re.IGNORECASE | re.DOTALL)
_PARAMETER: Final = re.compile(
    r"(?:INOUT|VAR|PERS|switch)?\s*[\w\x80-\xff]+\s+([\w\x80-\xff]+)\s*+(?:\{[^}]*+\}\s*+)?$"
)
_COMPACT: Final = re.compile(
    rb'(?:"(?:[^"\r\n]|"")*+"|![^\r\n]*+|[^"!\w\x80-\xff]|'
    + scan.WORD
    + rb"(?:\s*+\.\s*+"
    + scan.WORD
    + rb")*+)*?(?<![\w\x80-\xff])"
    rb"((?:Move|Trigg|Search|Arc)" + scan.WORD + rb"|" + scan.WORD + rb"(?=\s*+(?:\{[^{}]*+\}"
    rb"\s*+)?+(?:\.\s*+" + scan.WORD + rb"\s*+)*+:=)|GOTO|RETURN|EXIT)(?![\w\x80-\xff])",
    re.IGNORECASE | re.DOTALL,
)


class RapidWalk(Data):
    """One reading of a module, with frames from the files beside it."""

    def __init__(self, data: bytes, name: str, frames: RapidFrames, course: Course) -> None:
        super().__init__(data, name, frames, course)
        self._open, self._in_record, self._with_parameters = 0, False, False
        self._tails: dict[tuple[bytes, bytes], Tail | None] = {}
        self._calls: list[tuple[int, str, int]] = []
        self._routines: set[str] = set()
        self._shifts: list[tuple[int, str]] = []

    def declarations(self) -> None:
        """Reads the tools and work objects only: a file beside the program."""
        if not _CHANGES.search(self.data):
            names = (name.decode("latin-1").lower() for name in _ROUTINE.findall(self.data))
            self.frames.routines.update(names)
        at = scan.beginning(self.data)
        while True:
            statement, at = scan.next_statement(self.data, at, self.name)
            if statement is None:
                return
            self.declare(statement, frames_only=True)

    def all(self) -> None:
        """Reads every statement."""
        at = scan.beginning(self.data)
        while True:
            self.place += 1
            inline = scan.INLINE.match(self.data, at)
            if inline and self._inline(inline):
                at = inline.end()
                continue
            statement, at = scan.next_statement(self.data, at, self.name)
            if statement is None:
                break
            self._statement(statement)
        if self._open:
            raise FormatError(
                "the module has no ENDMODULE: the file is cut off.",
                source=self.name,
                line=line_at(self.data, len(self.data)),
                hint="export it again.",
            )

    def outside(self, harmless: Container[str]) -> list[tuple[str, int]]:
        """Returns name and first byte of the calls of routines called that stand in no file here.

        The course knows from then on which of displacement, tools and work objects each may have
        changed: ``FOREIGN`` keys hold one more than its number here.

        Args:
            harmless: Routines that change none of them.
        """
        calls = [(p, _BY_NAME if name == "late" else name, at) for p, name, at in self._calls]
        known = self._routines | self.frames.routines
        found = [each for each in calls if each[1] not in known and each[1] not in harmless]
        data = {(side, name) for pair in self.story.settings for side, name in
                ((TOOL, pair[0]), (WORK, pair[1]))}  # fmt: skip
        for key in (SHIFTED, AXES_SHIFTED, *(each for each in data if self._open_to_all(*each))):
            for number, (place, _, _) in enumerate(found, start=1):
                self.course.set(place, (FOREIGN, key), number)
        for place, key in (*self._shifts, *self.frames.renewed):
            self.course.set(place, (FOREIGN, key), 0)
        return [(name, at) for _, name, at in found]

    def _open_to_all(self, side: str, name: str) -> bool:
        """Returns whether routines of other modules may change a tool or work object."""
        if name in ("", "tool0", "wobj0") or (side, name) in self.frames.own:
            return False
        return re.fullmatch(r"[\w\x80-\xff]+", name) is not None

    def _statement(self, statement: scan.RapidStatement) -> None:
        word = statement.word
        move = move_of(word)
        if move is not None:
            self._move(statement.body, statement.end, move)
        elif word in _SHIFTS:
            self.course.set(self.place, *_SHIFTS[word])
            self._shifts.append((self.place, _SHIFTS[word][0]))
            self.mention(statement.body, statement.end, word)
        elif not self._control(statement, word) and not self.declare(statement):
            if not self.assign(statement.start, statement.end):
                self._instruction(statement)

    def _instruction(self, statement: scan.RapidStatement) -> None:
        """What is neither motion nor assignment: an instruction, or a call of a routine."""
        start, end, word = statement.body, statement.end, statement.word
        self.mention(start, end, word)
        if word in ("confl", "confj"):
            said = " ".join(scan.clean(self.data[statement.start : end]).split())
            if said.lower().endswith("off"):
                self.story.checks.setdefault(said, statement.start)
        if word not in BUILT_IN:
            self._calls.append((self.place, word, statement.start))
            self.course.call(self.place, [word])
        for match in scan.ROBTARGET.finditer(self.data, start, end):
            point = self.add_point(match.start(), self.table.add(*match.span(), POSE), POSE)
            self.story.flags[point] = Reason.EXPRESSION
            self.story.notes.append((match.start(), f"{word} is no motion that is followed"))

    def _control(self, statement: scan.RapidStatement, word: str) -> bool:
        """Follows branches, loops, jumps and routines; returns whether the word is one of them."""
        course, at = self.course, self.place
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
        self.mention(statement.body, statement.end, "")
        return True

    def _section(self, statement: scan.RapidStatement, word: str) -> bool:
        """Follows the parts a module is made of; returns whether the word is one of them."""
        if word in ("proc", "func", "trap"):
            self._routine(statement, word)
        elif word in ("endproc", "endfunc", "endtrap"):
            self.scope = ""
        elif word in ("error", "undo", "backward"):
            self.course.start(self.place, f"{self.scope} {word}", handler=True)
        elif word == "module":
            self._open, self.story.begun = self._open + 1, True
        elif word == "endmodule":
            self._open = max(0, self._open - 1)
        elif word in ("record", "endrecord"):
            self._in_record = word == "record"
        else:
            return word == "prefix" or self._in_record
        return True

    def _text(self, statement: scan.RapidStatement) -> str:
        return scan.clean(self.data[statement.body : statement.end])

    def _routine(self, statement: scan.RapidStatement, word: str) -> None:
        before, _, parameters = self._text(statement).partition("(")
        names = before.split()
        self.scope = names[-1].lower() if names else ""
        self._routines.add(self.scope)
        self.course.start(self.place, self.scope, handler=word == "trap")
        self._with_parameters = bool(parameters.strip(") "))
        for each in re.split(r"[,|\\]", parameters.rstrip(") ")):
            match = _PARAMETER.match(each.strip())
            if match:
                self.variables.declare(self.scope, match[1].lower(), "parameter").outside = True

    def _compact(self, statement: scan.RapidStatement) -> None:
        """``IF condition instruction;``: the instruction runs on one of two ways."""
        self.course.branch(self.place, opens=True)
        match = _COMPACT.match(self.data, statement.body, statement.end)
        self.place += 1
        if match is None:
            self.mention(statement.body, statement.end, "if")
            text = self._text(statement).lower()
            self.course.call(self.place, re.findall(r"[\w\x80-\xff]+", text))
            word = _behind_condition(text)
            if word and word not in BUILT_IN:
                self._calls.append((self.place, word, statement.start))
        else:
            start, body = match.start(1), match.end(1)
            self.mention(statement.body, start, "")
            self._statement(
                scan.RapidStatement(match[1].decode("latin-1").lower(), start, body, statement.end)
            )
        self.place += 1
        self.course.join(self.place)

    def _inline(self, match: re.Match[bytes]) -> bool:
        """Enters a motion to a literal; returns whether its other arguments are understood."""
        key = match[1], match[3]
        move = move_of(key[0].decode("latin-1").lower())
        if len(self._tails) > _TAILS:
            self._tails.clear()
        if move is not None and key not in self._tails:
            self._tails[key] = read_tail(self.data, *match.span(3), move, given=1)
        tail = self._tails.get(key)
        if move is None or tail is None or tail.places:
            return False
        self.story.begun = True
        start, end = match.span(2)
        point = self.add_point(start, self.table.add(start, end, POSE), POSE)
        self._use(point, move.motion, tail, start)
        return True

    def _move(self, start: int, end: int, move: Move) -> None:
        self.story.begun = True
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
            self.story.arcs += [(a, last[0]) for a in via] + [(via[0], b) for b in last]

    def _use(self, point: int, motion: int, tail: Tail, start: int) -> None:
        settings = self.story.settings
        key = tail.tool, tail.work
        if self._with_parameters and any(self._is_parameter(name) for name in key):
            key = (f"{tail.tool} ({self.scope})", f"{tail.work} ({self.scope})")
        number, _ = settings.setdefault(key, (len(settings), start))
        self.story.uses.add(point, self.place, motion, number)

    def _is_parameter(self, name: str) -> bool:
        variable = self.variables.find(self.scope, name)
        return variable is not None and variable.outside

    def _target(self, start: int, end: int, move: Move) -> list[int]:
        """Returns the points a target argument may mean; one of no numbers if none is known."""
        kind = "jointtarget" if move.axes else "robtarget"
        pattern, code = LITERAL[kind]
        match = scan.fills(pattern, self.data, start, end)
        if match:
            return [self.add_point(start, self.table.add(*match.span(), code), code)]
        text = scan.clean(self.data[start:end])
        named = _REFERENCE.match(text)
        if named:
            variable = self.variables.find(self.scope, named[1].lower())
            subscript: str | None = re.sub(r"\s+", "", named[2] or "")
            if subscript and not re.fullmatch(r"\d+(,\d+)*", subscript):
                subscript = None
            if variable is not None and variable.kind == kind:
                points = self.variables.points_at(variable, subscript, self.course.barriers)
                if points:
                    return points
            module = self.frames.elsewhere.get(named[1].lower())
            why = "is in no file of this program"
            if variable is not None:
                why = "is a parameter or is computed"
            elif module is not None:
                why = f"stands in {module}: declare it in the module that moves to it"
            return [self._lose_point(start, Reason.EXPRESSION, f"the target {text[:40]!r} {why}")]
        shifting = _SHIFTING.match(text)
        if shifting:
            if not self._mark_based(shifting[2]):
                self.mention(start, end, "")
            comma = self.data.find(b",", start, end)
            self.mention(comma if comma >= 0 else end, end, "")
            return [
                self._lose_point(
                    start, Reason.RELATIVE, f"{shifting[1]} starts from another target"
                )
            ]
        self.mention(start, end, "")
        return [self._lose_point(start, Reason.EXPRESSION, f"the target {text[:40]!r} is computed")]

    def _mark_based(self, inside: str) -> bool:
        """Marks the points that Offs or RelTool start from; returns whether they are a variable."""
        named = _REFERENCE.match(inside.split(",")[0].strip())
        variable = self.variables.find(self.scope, named[1].lower()) if named else None
        if variable is None:
            return False
        points = self.variables.points_at(variable, None, self.course.barriers)
        self.story.based.update(points)
        return True

    def _lose_point(self, offset: int, reason: Reason, what: str) -> int:
        point = self.add_point(offset, -1, NOTHING)
        self.story.flags[point] = reason
        self.story.notes.append((offset, what))
        return point


def _behind_condition(text: str) -> str:
    """Returns the instruction of ``IF condition instruction``: the word right behind an operand."""
    operand = False
    for token in _TOKEN.findall(text):
        word = token[0].isalnum() or token[0] == "_" or token[0] >= "\x80"
        if operand and word and token not in _OPERATORS:
            return str(token)
        operand = (word and token not in _OPERATORS) or token[-1] in ')]}"'
    return ""
