"""Reads the statements of a RAPID module in order: points, motions, tools, work objects."""

from __future__ import annotations

import re
from array import array
from typing import Final, NamedTuple

from robotrue.core.arrays import Array
from robotrue.errors import FormatError
from robotrue.program.formats import rapid_scan as scan
from robotrue.program.formats.expression import NotConstantError
from robotrue.program.formats.rapid_beside import called_by_name
from robotrue.program.formats.rapid_calls import Calls
from robotrue.program.formats.rapid_data import LITERAL, NOTHING, POSE, RapidSource
from robotrue.program.formats.rapid_expression import flat_numbers, pose_of
from robotrue.program.formats.rapid_flow import SHIFTS
from robotrue.program.formats.rapid_moves import (
    BUILT_IN,
    Move,
    Tail,
    behind_condition,
    move_of,
    read_tail,
)
from robotrue.program.formats.rapid_values import RapidChange
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import Motion, Reason

_TAILS: Final = 4096
"""Largest number of cached texts of a motion after its literal; a post writes only a few."""
_HEADS: Final = frozenset(("if", "if then", "elseif", "case", "while", "func"))
"""Functions in them are called at another place than before the statement, or there are none."""
_REFERENCE: Final = re.compile(r"([\w\x80-\xff]+)\s*(?:\{([^}]*)\})?$")
_SHIFTING: Final = re.compile(r"(offs|reltool)\s*\((.*)\)$", re.IGNORECASE | re.DOTALL)
_BETWEEN: Final = re.compile(r"\\\s*ExeP\s*:=\s*(\w+)\s*,\s*(\w+)\s*,", re.IGNORECASE)
"""What a displacement between two targets names; with other options it is not followed."""
_NAMED: Final = re.compile(r"[A-Za-z_\x80-\xff][\w\x80-\xff]*")
_PARAMETER: Final = re.compile(
    r"(?:INOUT|VAR|PERS|switch)?\s*[\w\x80-\xff]+\s+([\w\x80-\xff]+)\s*+(?:\{[^}]*+\}\s*+)?$"
)


class _Motion(NamedTuple):
    """A motion whose targets are settled when everything has been read."""

    place: int
    scope: str
    barriers: int
    with_parameters: bool
    start: int
    move: Move
    tail: Tail
    stored: list[tuple[list[int], list[str]] | None]


class RapidWalk(Calls):
    """One reading of a module, with frames from the files next to it."""

    def __init__(self, source: RapidSource) -> None:
        super().__init__(source)
        self._moves: list[_Motion] = []
        self._barriers = 0
        self._open, self._in_record, self._with_parameters = 0, False, False
        self._tails: dict[tuple[bytes, bytes], tuple[Move | None, Tail | None]] = {}
        self._handler = 0  # where the error handler being read begins

    def all(self) -> None:
        """Reads every statement."""
        at, ahead = scan.beginning(self.data), None
        while True:
            self.place += 1
            inline = ahead or scan.UNCOMMENTED.match(self.data, at)
            inline = inline or scan.INLINE.match(self.data, at)
            end, ahead = self._inline(inline) if inline else (at, None)
            if end > at:
                at = end
                continue
            statement, at = scan.next_statement(self.data, at, self.name)
            if statement is None:
                break
            self._statement(statement)
        self.find_absent()
        self._settle_moves()
        if self._open:
            raise FormatError(
                "the module has no ENDMODULE: the file is cut off.",
                source=self.name,
                line=line_at(self.data, len(self.data)),
                hint="export it again.",
            )

    def _statement(self, statement: scan.RapidStatement) -> None:
        word = statement.word
        if self.has_functions and word not in _HEADS:
            self.use_functions(statement.body, statement.end)
        move = move_of(word)
        if move is not None:
            self._move(statement.body, statement.end, move)
        elif word in SHIFTS:
            self._shift(statement, word)
        elif not self._control(statement, word) and not self.declare(statement):
            if not self.assign(statement.start, statement.end):
                self._instruction(statement)

    def _shift(self, statement: scan.RapidStatement, word: str) -> None:
        """Enters a displacement or offset; one of constants is known when all has been read."""
        key, version = SHIFTS[word]
        text = self._displacement(statement, word)
        if text:
            version = 2 + len(self.story.displaced)
            self.story.displaced[version] = (self.place, self.scope, text)
        self.course.set(self.place, key, version)
        self._shifts.append((self.place, key))
        self.mention(statement.body, statement.end, word)

    def _displacement(self, statement: scan.RapidStatement, word: str) -> str:
        """Returns the expression of a displacement, empty if it depends on the robot's position."""
        if word == "pdispset":
            return self._text(statement)
        match = _BETWEEN.match(self._text(statement)) if word == "pdispon" else None
        return f"[{match[1]}.trans - {match[2]}.trans, [1,0,0,0]]" if match else ""

    def displacement(self, version: int) -> Array | None:
        """Returns the displacement (4, 4), m, of a version of ``SHIFTED``; None if not known."""
        if version not in self.story.displaced:
            return None
        place, scope, text = self.story.displaced[version]
        try:
            return pose_of(self.values.value(text, place, scope))
        except NotConstantError:
            return None

    def _instruction(self, statement: scan.RapidStatement) -> None:
        """What is neither motion nor assignment: an instruction, or a call of a routine."""
        start, end, word = statement.body, statement.end, statement.word
        self.mention(start, end, word)
        if word in ("confl", "confj"):
            said = " ".join(scan.clean(self.data[statement.start : end]).split())
            if said.lower().endswith("off"):
                self.story.checks.setdefault(said, statement.start)
        if word in ("late", "callbyvar"):
            word = called_by_name(scan.clean(self.data[statement.start : end]).lower())
        if word not in BUILT_IN:
            self.call(word, statement.start)
        for match in scan.ROBTARGET.finditer(self.data, start, end):
            point = self.story.add(match.start(), self.table.add(*match.span(), POSE), POSE)
            self.story.flags[point] = Reason.EXPRESSION
            self.story.notes.append((match.start(), f"{word} is no motion that is followed"))

    def _control(self, statement: scan.RapidStatement, word: str) -> bool:
        """Follows branches, loops, jumps and routines; returns whether the word is one of them."""
        course, at = self.course, self.place
        if word in ("if then", "test"):
            course.branch(at, opens=word != "test")
            self.condition(statement.body, statement.end, course.condition)
        elif word in ("else", "elseif", "case", "default"):
            course.alternative(at, other=word in ("else", "default"))
            self.condition(statement.body, statement.end, course.condition)
        elif word in ("endif", "endtest"):
            course.join(at)
        elif word in ("for", "while"):
            course.loop(at)
            if word == "while":
                self.condition(statement.body, statement.end, course.loop_condition)
            for name in self._text(statement).lower().split()[:1] if word == "for" else ():
                self.values.change(self.scope, name, RapidChange(at, "", "", None))
        elif word in ("endfor", "endwhile"):
            course.close_loop(at)
        elif word == "return":
            course.leave(at)
        elif word in ("exit", "exitcycle"):
            course.restart(at, cycle=word == "exitcycle")
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
            self._end_handler(statement)
            self.values.end_routine(self.place)
            self.scope = ""
        elif word in ("error", "undo", "backward"):
            self._end_handler(statement)
            self._handler = statement.end if word == "error" and self.scope else 0
            self.course.start(self.place, f"{self.scope} {word}", handler=True)
            self.values.begin_routine(self.place, f"{self.scope} {word}", handler=True)
        elif word == "module":
            self._open, self.story.begun = self._open + 1, True
        elif word == "endmodule":
            self._open = max(0, self._open - 1)
        elif word in ("record", "endrecord"):
            self._in_record = word == "record"
        else:
            return word == "prefix" or self._in_record
        return True

    def _end_handler(self, statement: scan.RapidStatement) -> None:
        if self._handler:
            text = scan.clean(self.data[self._handler : statement.start])
            self.course.catch(self.scope, text)
        self._handler = 0

    def _text(self, statement: scan.RapidStatement) -> str:
        return scan.clean(self.data[statement.body : statement.end])

    def _routine(self, statement: scan.RapidStatement, word: str) -> None:
        before, _, parameters = self._text(statement).partition("(")
        names = before.split()
        self.scope = names[-1].lower() if names else ""
        self.routines.add(self.scope)
        self.course.start(self.place, self.scope, handler=word == "trap")
        self.values.begin_routine(self.place, self.scope, handler=word == "trap")
        self._with_parameters = bool(parameters.strip(") "))
        for each in re.split(r"[,|\\]", parameters.rstrip(") ")):
            match = _PARAMETER.match(each.strip())
            if match:
                self.variables.declare(self.scope, match[1].lower(), "parameter").outside = True
                self.values.declare(self.scope, match[1].lower(), None, local=True)

    def _compact(self, statement: scan.RapidStatement) -> None:
        """``IF condition instruction;``: the instruction runs on one of two ways."""
        self.course.branch(self.place, opens=True)
        match = scan.COMPACT.match(self.data, statement.body, statement.end)
        if match is None:
            self.place += 1
            self.mention(statement.body, statement.end, "if")
            text = self._text(statement).lower()
            self.use_functions(statement.body, statement.end)
            word = behind_condition(text)
            if word in SHIFTS:
                self.course.set(self.place, *SHIFTS[word])
                self._shifts.append((self.place, SHIFTS[word][0]))
            elif word == "exitcycle":
                self.course.restart(self.place, cycle=True)
            elif word and word not in BUILT_IN:
                self.call(word, statement.start)
        else:
            start, body = match.start(1), match.end(1)
            self.mention(statement.body, start, "")
            self.condition(statement.body, start, self.course.condition)
            self.place += 1
            self._statement(
                scan.RapidStatement(match[1].decode("latin-1").lower(), start, body, statement.end)
            )
        self.place += 1
        self.course.join(self.place)

    def _inline(self, match: re.Match[bytes]) -> tuple[int, re.Match[bytes] | None]:
        """Enters motions to literals, alike otherwise; returns their end and the motion there.

        The end is that of the statement before where their other arguments are not understood.
        """
        key = match[1], match[3]
        known = self._tails.get(key)
        if known is None:
            if len(self._tails) > _TAILS:
                self._tails.clear()
            move = move_of(key[0].decode("latin-1").lower())
            tail = read_tail(self.data, *match.span(3), move, given=1) if move else None
            known = self._tails[key] = move, tail
        move, tail = known
        at, edges = match.start(), array("q")
        if move is None or tail is None or tail.places:
            return at, None
        self.story.begun = True
        ahead: re.Match[bytes] | None = match
        while ahead and ahead.group(1, 3) == key:
            edges.extend(ahead.span(2))
            at = ahead.end()
            ahead = scan.UNCOMMENTED.match(self.data, at)
        begins = edges[::2]
        points = self.story.extend(begins, self.table.extend(edges, POSE), POSE)
        places = range(self.place, self.place + len(points))
        number = self._number_setting(tail, begins[0])
        self.story.uses.extend(points, places, move.motion, number)
        self.place = places[-1]
        return at, ahead

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
        key = self._name_setting(tail)
        self.story.settings.setdefault(key, (len(self.story.settings), start))
        stored = [self._look_up(a, b, "jointtarget" if move.axes else "robtarget")
                  for a, b in tail.places]  # fmt: skip
        self._moves.append(
            _Motion(
                self.place, self.scope, self.course.barriers, self._with_parameters, start, move,
                tail, stored,
            )
        )  # fmt: skip

    def _look_up(self, start: int, end: int, kind: str) -> tuple[list[int], list[str]] | None:
        """Returns the points a name means here, and the elements of which that is not certain."""
        named = _REFERENCE.match(scan.clean(self.data[start:end]))
        variable = self.variables.find(self.scope, named[1].lower()) if named else None
        if named is None or variable is None or variable.kind != kind:
            return None
        subscript: str | None = re.sub(r"\s+", "", named[2] or "")
        if subscript and not re.fullmatch(r"\d+(,\d+)*", subscript):
            subscript = None
        return self.variables.look_up(variable, subscript, self.course.barriers)

    def _settle_moves(self) -> None:
        """Enters the targets of all motions that are not to a literal alone."""
        last = self.place, self.scope, self._with_parameters
        for motion in self._moves:
            self.place, self.scope, self._barriers = motion.place, motion.scope, motion.barriers
            self._with_parameters = motion.with_parameters
            used = []
            for number, (a, b) in enumerate(motion.tail.places):
                via = motion.move.targets == 2 and number == 0
                how = Motion.ARC_VIA if via else motion.move.motion
                points = self._target(a, b, motion.move, motion.stored[number])
                used.append(points)
                for point in points:
                    self._use(point, how, motion.tail, motion.start)
            if len(used) == 2:
                self._pair(*used)
        self.place, self.scope, self._with_parameters = last
        self.follow_derived()

    def _pair(self, via: list[int], last: list[int]) -> None:
        if len(via) == len(last):
            self.story.arcs += zip(via, last, strict=True)
        else:
            self.story.arcs += [(a, last[0]) for a in via] + [(via[0], b) for b in last]

    def _use(self, point: int, motion: int, tail: Tail, start: int) -> None:
        self.story.uses.add(point, self.place, motion, self._number_setting(tail, start))

    def _number_setting(self, tail: Tail, start: int) -> int:
        """Returns the number of the tool and work object of a motion."""
        settings = self.story.settings
        return settings.setdefault(self._name_setting(tail), (len(settings), start))[0]

    def _name_setting(self, tail: Tail) -> tuple[str, str]:
        """Returns the names of tool and work object of a motion, parameters with their routine."""
        key = tail.tool, tail.work
        if self._with_parameters and any(self._is_parameter(name) for name in key):
            return f"{tail.tool} ({self.scope})", f"{tail.work} ({self.scope})"
        return key

    def _is_parameter(self, name: str) -> bool:
        variable = self.variables.find(self.scope, name)
        return variable is not None and variable.outside

    def _target(
        self, start: int, end: int, move: Move, stored: tuple[list[int], list[str]] | None
    ) -> list[int]:
        """Returns the points a target argument may mean; one of no numbers if none is known."""
        kind = "jointtarget" if move.axes else "robtarget"
        pattern, code = LITERAL[kind]
        match = scan.fills(pattern, self.data, start, end)
        if match:
            return [self.story.add(start, self.table.add(*match.span(), code), code)]
        text = scan.clean(self.data[start:end])
        named = _REFERENCE.match(text)
        if self._is_evaluated(named, kind, stored):
            try:
                return [self._write_out(start, end, text, code)]
            except NotConstantError as cause:
                why = f"{cause}; {cause.cure}" if cause.cure else str(cause)
                self.story.notes.append((start, f"{text[:40]!r} has no single value: {why}"))
                if named:  # what it was computed from must keep its numbers
                    self.read.add(self.values.key(self.scope, named[1].lower()))
        if named:
            variable = self.variables.find(self.scope, named[1].lower())
            if variable is not None and stored is not None and stored[0]:
                if all(one in variable.all for one in stored[1]):
                    self.variables.doubt(variable, stored[1])
                    return stored[0]
            module = self.frames.elsewhere.get(named[1].lower())
            why = "is in no file of this program"
            if variable is not None:
                why = "is a parameter or is computed"
            elif module is not None:
                why = f"is in {module}: declare it in the module that moves to it"
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

    def _is_evaluated(
        self,
        named: re.Match[str] | None,
        kind: str,
        stored: tuple[list[int], list[str]] | None,
    ) -> bool:
        """Returns whether a target is not one literal of this module."""
        if named is None:
            return True
        variable = self.variables.find(self.scope, named[1].lower())
        if variable is None or variable.kind != kind or variable.outside or stored is None:
            return variable is None
        if variable.computed or not stored[0]:
            return True
        return len(stored[0]) == 1 and any(len(variable.all.get(one, ())) > 1 for one in stored[1])

    def _write_out(self, start: int, end: int, text: str, code: int) -> int:
        """Returns a new point that is written out where a motion computes it.

        Raises:
            NotConstantError: It has no single value.
        """
        numbers = flat_numbers(self.values.value(text, self.place, self.scope), code)
        point = self.story.add(start, -1, code)
        self.story.written[point] = (start, end, numbers)
        for name in map(str.lower, _NAMED.findall(text)):
            variable = self.variables.find(self.scope, name)
            if variable is not None:
                bases = [one for points in variable.all.values() for one in points]
                self.story.bases.setdefault(point, []).extend(bases)
            elif self.values.task.is_given(name):
                self.story.bases.setdefault(point, []).append(point)
        return point

    def _mark_based(self, inside: str) -> bool:
        """Marks the points that Offs or RelTool start from; returns whether they are a variable."""
        named = _REFERENCE.match(inside.split(",")[0].strip())
        variable = self.variables.find(self.scope, named[1].lower()) if named else None
        if variable is None:
            return False
        points = self.variables.points_at(variable, None, self._barriers)
        self.story.based.update(points)
        return True

    def _lose_point(self, offset: int, reason: Reason, what: str) -> int:
        point = self.story.add(offset, -1, NOTHING)
        self.story.flags[point] = reason
        self.story.notes.append((offset, what))
        return point
