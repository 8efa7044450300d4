"""Puts targets into RAPID modules: MoveL and MoveC with targets in brackets, in data or in arrays.

What is put in is a statement of its own before the move, a copy of it with the new target in
brackets, also where the move names a target: names, declarations and array bounds stay as they are.
``fine`` becomes ``z0`` in the copies: at ``fine`` the robot stops; at ``z0`` it passes within
0.3 mm. Zones larger than half a part are made smaller by the controller.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import MM
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    Literals,
    Trail,
    TrailStatement,
    groups,
    indentation,
    line_end,
    put_in,
    repeat_statement,
)
from robotrue.program.formats.number_text import WHOLE_NUMBER, restyle
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
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Insertion, Moves, Obstacle, job_rows
from robotrue.program.program import Motion, Program

_GIVEN: Final = re.compile(
    rb"(?:^|;)[ \t]*+(?:(?:(?:LOCAL|TASK|GLOBAL)\b" + GAP + rb")?(?:CONST|PERS|VAR)\b" + GAP
    + rb"robtarget\b" + GAP + rb")?(?P<name>[\w\x80-\xff]++)" + GAP
    + rb"(?:\{(?P<at>[^{}]*+)\}" + GAP + rb")?:=" + GAP,
    re.IGNORECASE | re.MULTILINE,
)  # fmt: skip
_REFERENCE: Final = re.compile(r"([\w\x80-\xff]+)\s*(?:\{\s*(\d+)\s*\})?$")
_NUMBER: Final = re.compile(WHOLE_NUMBER)
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
"""Ways a motion goes on behind its literal that are remembered."""
_FORM: Final = ("inpos", "id")
_ZONE: Final = {"movel": 2, "movec": 3}
"""Place of the zone among the arguments."""
_COUNT: Final = 11
"""Numbers of a robtarget that may change: position, quaternion, confdata."""


class RapidInserter:
    """See the module."""

    def moves(self, job: Sequence[Program]) -> Moves:
        """Returns the moves of a job."""
        trail, literals = Trail(), _literals(job)
        given = _find_given(job, literals)
        for file, program in enumerate(job):
            _Reader(trail, literals, given, file, program).read()
        return trail.moves()

    def insert(
        self, job: Sequence[Program], moves: Moves, insertion: Insertion
    ) -> tuple[bytes, ...]:
        """Returns the bytes of every program with the targets put in.

        Raises:
            ShapeError: A move with an obstacle, or a value that cannot be written.
        """
        first = job_rows(job)
        edits: list[list[tuple[int, int, bytes]]] = [[] for _ in job]
        for group in groups(moves, insertion):
            s, data = group.statement, job[group.statement.file].data
            texts = []
            for k, row in enumerate(group.rows):
                model = (moves.via if s.via >= 0 and k % 2 == 0 else moves.end)[group.move]
                file = int(np.searchsorted(first, model, side="right")) - 1
                literal = _literal(job[file], int(model - first[file]))
                texts.append(
                    _retarget(
                        literal,
                        insertion.position[row],
                        insertion.rotation[row],
                        insertion.words[row],
                    )
                )
            tail = data[s.target_end : s.end]
            if s.other >= 0 and data[s.other : s.other + 4].lower() == b"fine":
                tail = data[s.target_end : s.other] + b"z0" + data[s.other + 4 : s.end]
            behind = b";" + line_end(data) + indentation(data, s.begin)
            new = b"".join(text + behind for text in repeat_statement(data, s, texts, tail))
            edits[s.file].append((s.begin, 0, new))
        return tuple(put_in(job, edits))


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
        """What of a motion's word and arguments keeps it whole."""
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
    """Returns the brackets a row stands in, on one line and without comments."""
    at = int(program.spans.numbers.start[row, 0])
    begin = program.data.rfind(b"[", 0, program.data.rfind(b"[", 0, at))
    match = ROBTARGET.match(program.data, begin)
    text = match[0] if match else b""
    return text if b"\n" not in text and b"!" not in text else _on_one_line(text)


def _on_one_line(text: bytes) -> bytes:
    """Returns a literal without line ends and comments."""
    return re.sub(rb"![^\r\n]*|\s+", b"", text)


def _retarget(literal: bytes, position: Array, rotation: Array, words: IntArray) -> bytes:
    """Returns the brackets with another pose, and other confdata where they are given."""
    tokens = list(_NUMBER.finditer(literal))[:_COUNT]
    printed = [float(each[0]) for each in tokens]
    quat = quat_wxyz_from_matrix(rotation)
    quat = -quat if float(quat @ printed[3:7]) < 0.0 else quat
    values = [*(position / MM).tolist(), *quat.tolist(), *words.tolist()]
    least = [4] * 3 + [8] * 4 + [0] * 4
    out, cursor = [], 0
    for token, value, digits in zip(tokens, values, least, strict=True):
        out.append(literal[cursor : token.start()])
        kept = digits == 0 and value == NO_WORD
        out.append(token[0] if kept else restyle(token[0], value, least=digits))
        cursor = token.end()
    return b"".join(out) + literal[cursor:]


INSERTER: Final = RapidInserter()
