"""Inserts targets into RAPID modules: MoveL and MoveC with targets in brackets, data or arrays.

An insertion is a separate statement before the move, a copy of it with the new target in brackets,
also where the move names a target: names, declarations and array bounds stay as they are. ``fine``
becomes ``z0`` in the copies: at ``fine`` the robot stops; at ``z0`` it passes within 0.3 mm. Zones
larger than half a part are made smaller by the controller.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import MM
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    Literals,
    Trail,
    TrailStatement,
    indentation,
    line_end,
    repeat_statement,
)
from robotrue.program.formats.number_text import WHOLE_NUMBER, Stretch, respell_literal
from robotrue.program.formats.rapid_moves import BUILT_IN, move_of
from robotrue.program.formats.rapid_scan import (
    GAP,
    INLINE,
    ROBTARGET,
    Arguments,
    RapidStatement,
    arguments,
    beginning,
    clean,
    fills,
    next_statement,
)
from robotrue.program.formats.statement_insert import MoveCopy, StatementInserter
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Insertion, Obstacle
from robotrue.program.program import Motion, Program

_GIVEN: Final = re.compile(
    rb"(?:^|;)[ \t]*+(?:(?:(?:LOCAL|TASK|GLOBAL)\b" + GAP + rb")?(?:CONST|PERS|VAR)\b" + GAP
    + rb"robtarget\b" + GAP + rb")?(?P<name>[\w\x80-\xff]++)" + GAP
    + rb"(?:\{(?P<at>[^{}]*+)\}" + GAP + rb")?:=" + GAP,
    re.IGNORECASE | re.MULTILINE,
)  # fmt: skip
_REFERENCE: Final = re.compile(r"([\w\x80-\xff]+)\s*(?:\{\s*(\d+)\s*\})?$")
_PLAIN: Final = ("movel", "movec")
_LOOPS: Final = {"for": 1, "while": 1, "endfor": -1, "endwhile": -1}
_TURNS: Final = frozenset(
    "if|if then|else|elseif|endif|test|case|default|endtest|goto|label|return|exit|late".split("|")
)
_ROUTINES: Final = frozenset(
    "proc func trap endproc endfunc endtrap error undo backward module endmodule".split()
)
_SEARCHES: Final = re.compile(r"search|moveextj|startmove|restopath|capl|arc[\w\x80-\xff]|spot")
_DECLARES: Final = frozenset("local task global const pers var".split())
_TAILS: Final = 4096
"""Largest number of cached texts of a motion after its literal."""
_FORM: Final = ("inpos", "id")
_ZONE: Final = {"movel": 2, "movec": 3}
"""Place of the zone among the arguments."""
_LEAST: Final = (4, 4, 4, 8, 8, 8, 8, 0, 0, 0, 0)
"""Decimals of the numbers of a robtarget that may change: position, quaternion, confdata."""


def _read_job(trail: Trail, job: Sequence[Program]) -> None:
    literals = _literals(job)
    given = _find_given(job, literals)
    for file, program in enumerate(job):
        _Reader(trail, literals, given, file, program).read()


def _copy_move(copy: MoveCopy) -> list[Stretch]:
    """Returns the statements inserted before a move, copies of it with the target in brackets."""
    s, data = copy.statement, copy.data
    texts = [
        _retarget(_literal(program, own), copy.insertion, row) for program, own, row in copy.models
    ]
    tail = data[s.target_end : s.end]
    if s.other >= 0 and data[s.other : s.other + 4].lower() == b"fine":
        tail = data[s.target_end : s.other] + b"z0" + data[s.other + 4 : s.end]
    behind = b";" + line_end(data) + indentation(data, s.begin)
    new = b"".join(text + behind for text in repeat_statement(data, s, texts, tail))
    return [(s.begin, 0, new)]


def _literals(job: Sequence[Program]) -> Literals:
    return Literals([program.spans.numbers.start[:, 0] for program in job])


def _find_given(job: Sequence[Program], literals: Literals) -> dict[tuple[str, str], set[int]]:
    """Returns the job rows every named target, or element of an array, is given."""
    out: dict[tuple[str, str], set[int]] = defaultdict(set)
    for file, program in enumerate(job):
        data = program.data
        for match in _GIVEN.finditer(data):
            name, at = match["name"].decode("latin-1").lower(), match.end()
            inside = match["at"].decode("latin-1").strip() if match["at"] else ""
            one = ROBTARGET.match(data, at)
            if one:
                out[name, inside].add(literals.row(file, *one.span()))
            elif inside and data[at : at + 1] == b"[":
                end = data.find(b";", at)
                for number, each in enumerate(ROBTARGET.finditer(data, at + 1, end), 1):
                    out[name, str(number)].add(literals.row(file, *each.span()))
            elif not inside or inside.isdigit():
                out[name, inside].add(UNKNOWN)
    return out


class _Reader:
    """Goes over the statements of one module."""

    def __init__(
        self,
        trail: Trail,
        literals: Literals,
        given: dict[tuple[str, str], set[int]],
        file: int,
        program: Program,
    ) -> None:
        self.trail, self.literals, self.given, self.file = trail, literals, given, file
        self.program, self.data = program, program.data
        self.lines: list[int] = line_starts(program.data).tolist()
        self.tails: dict[tuple[bytes, bytes], tuple[Obstacle, int]] = {}

    def read(self) -> None:
        """Reads every statement."""
        at = beginning(self.data)
        self.trail.routine()
        while True:
            inline = INLINE.match(self.data, at)
            if inline is not None and self._inline(inline):
                at = inline.end()
                continue
            statement, at = next_statement(self.data, at, self.program.name)
            if statement is None:
                return
            self._statement(statement)

    def _statement(self, statement: RapidStatement) -> None:
        word, trail = statement.word, self.trail
        move = move_of(word)
        if move is not None:
            self._move(statement, move.motion)
        elif word in _LOOPS:
            trail.loop(_LOOPS[word])
        elif word in _ROUTINES:
            trail.routine()
        elif word in _TURNS or _SEARCHES.match(word):
            trail.lose()
        elif word not in BUILT_IN and word not in _DECLARES:
            body = self.data[statement.start : statement.end]
            if b":=" not in body or b"(" in body.partition(b":=")[2]:
                trail.lose()  # a routine of the user may move

    def _inline(self, match: re.Match[bytes]) -> bool:
        """Takes a motion to a literal; posts end nearly all of them in the same few ways."""
        key = match[1], match[3]
        if key not in self.tails:
            word = match[1].decode("latin-1").lower()
            found = arguments(self.data, match.end(1), match.end() - 1)
            if found is None or len(found.places) <= _ZONE["movel"]:
                return False
            obstacle = self._obstacle(word, found)
            zone = found.places[_ZONE["movel"]][0] - match.start(3)
            if len(self.tails) < _TAILS:
                self.tails[key] = obstacle, zone
        else:
            obstacle, zone = self.tails[key]
        begin, end = match.span(2)
        row = self.literals.row(self.file, begin, end)
        if match[1][4:] in (b"J", b"j"):
            self.trail.arrive(row)
            return True
        place = UNKNOWN if obstacle else match.start(3) + zone
        s = TrailStatement(self.file, match.start(1), -1, -1, begin, end, match.end() - 1, place)
        line = bisect_right(self.lines, s.begin)
        self.trail.move(UNKNOWN, row, line, s, obstacle)
        return True

    def _obstacle(self, word: str, found: Arguments) -> Obstacle:
        """Returns the word or argument of a motion that prevents splitting it."""
        if word not in _PLAIN:
            return Obstacle.EVENT
        if "t" in found.options:
            return Obstacle.TIMED
        if any(name in found.options for name in _FORM) or len(found.places) <= _ZONE[word]:
            return Obstacle.FORM
        return Obstacle.NONE

    def _move(self, statement: RapidStatement, motion: Motion) -> None:
        s, word, trail = statement, statement.word, self.trail
        found = arguments(self.data, s.body, s.end)
        count = 2 if motion == Motion.ARC_END else 1
        if found is None or len(found.places) < count:
            trail.lose()
            return
        spans = found.places[:count]
        rows = [self._row(*span) for span in spans]
        if motion == Motion.PTP:
            trail.arrive(rows[0])
            return
        obstacle = self._obstacle(word, found)
        zone = found.places[_ZONE[word]][0] if not obstacle else UNKNOWN
        auxiliary = spans[0] if count == 2 else (UNKNOWN, UNKNOWN)
        line = bisect_right(self.lines, s.start)
        bytes_ = TrailStatement(self.file, s.start, *auxiliary, *spans[-1], s.end, zone)
        trail.move(rows[0] if count == 2 else UNKNOWN, rows[-1], line, bytes_, obstacle)

    def _row(self, begin: int, end: int) -> int:
        if fills(ROBTARGET, self.data, begin, end):
            return self.literals.row(self.file, begin, end)
        named = _REFERENCE.match(clean(self.data[begin:end]))
        rows = self.given.get((named[1].lower(), named[2] or ""), set()) if named else set()
        return next(iter(rows)) if len(rows) == 1 else UNKNOWN


def _literal(program: Program, row: int) -> bytes:
    """Returns the brackets that contain a row, on one line and without comments."""
    at = int(program.spans.numbers.start[row, 0])
    begin = program.data.rfind(b"[", 0, program.data.rfind(b"[", 0, at))
    match = ROBTARGET.match(program.data, begin)
    text = match[0] if match else b""
    return text if b"\n" not in text and b"!" not in text else _on_one_line(text)


def _on_one_line(text: bytes) -> bytes:
    """Returns a literal without line ends and comments."""
    return re.sub(rb"![^\r\n]*|\s+", b"", text)


def _retarget(literal: bytes, insertion: Insertion, row: int) -> bytes:
    """Returns the brackets with another pose, and other confdata where they are given."""
    printed = [float(token) for token in re.findall(WHOLE_NUMBER, literal)[3:7]]
    quat = quat_wxyz_from_matrix(insertion.rotation[row])
    quat = -quat if float(quat @ printed) < 0.0 else quat
    words = insertion.words[row]
    confdata = np.where(words == NO_WORD, np.nan, words)
    values = [*(insertion.position[row] / MM), *quat, *confdata]
    return respell_literal(literal, values, _LEAST)


INSERTER: Final = StatementInserter(read=_read_job, copy=_copy_move)
