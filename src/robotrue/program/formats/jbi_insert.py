"""Inserts targets into Yaskawa jobs: MOVL and the arcs of MOVC runs.

New C points are numbered on from the last and follow it in ``//POS``; the modal headers they need
precede them, and those in force before are repeated after them. ``///NPOS`` counts them. A copy of
the move names each, with its speed and position level; ``PL=0`` becomes ``PL=1`` in the copies: at
level 0 the robot stops. Without a level the controller's own approximation applies.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.errors import ShapeError
from robotrue.program.formats.jbi_scan import P_POINTS, UNITS, Header, JbiScan
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    MoveGroup,
    Trail,
    TrailStatement,
    groups,
    line_end,
    put_in,
)
from robotrue.program.formats.numbered_insert import (
    OneFileInserter,
    Run,
    Step,
    copy_statements,
    new_numbers,
)
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Insertion, Moves, Obstacle
from robotrue.program.program import Program

_MOVE: Final = re.compile(rb"MOV([JLCS])[ \t]+(C|P)(\d{1,6})\b(.*)", re.DOTALL)
_ANY_MOVE: Final = re.compile(rb"\+?[ \t]*(?:S?MOV|IMOV|EIMOV|REFP)")
_PARTNER: Final = re.compile(rb"(?<![\w#(])(?:C|P|BC|BP|EC|EX)(?:\d{1,6}\b|\[)|\+")
_QUIET: Final = re.compile(
    rb"(?:NOP|DOUT|AOUT|PULSE|TIMER|WAIT|SET|SETE|ADD|SUB|MUL|DIV|INC|DEC|AND|OR|XOR|NOT|CLEAR|MSG|"
    rb"ARCON|ARCOF|SPDL|DIN|ADVINIT|ADVSTOP|CNVRT|COMM)\b"
)
_LOOPS: Final = {b"WHILE": 1, b"FOR": 1, b"ENDWHILE": -1, b"NEXT": -1}
_WORD: Final = re.compile(rb"[A-Z]+")
_STOP: Final = re.compile(rb"\bPL=0\b")
_NPOS: Final = re.compile(rb"(///NPOS[ \t]+)(\d+)")
_MOST: Final = 99_999
"""Highest number of a C point of five digits."""


class _Reader:
    """Goes over the instructions of a job."""

    def __init__(self, trail: Trail, program: Program) -> None:
        self.trail, self.data, self.run = trail, program.data, Run(trail)
        self.found: JbiScan = program.spans.scan
        self.row = {number: row for row, number in enumerate(self.found.names.tolist())}
        self.starts = line_starts(program.data)
        self.numbered = bool((self.found.names < P_POINTS).any())
        self.shifted = False

    def read(self) -> None:
        """Reads every instruction."""
        self.trail.routine()
        for line, text in self.found.body:
            for own, each in ((line, text), *self.found.list_alike(line)):
                self._instruction(own, each.partition(b"'")[0].rstrip())
        self.run.close()

    def _instruction(self, line: int, text: bytes) -> None:
        move = _MOVE.match(text)
        if move is not None:
            self._move(line, text, move)
            return
        word = _WORD.match(text)
        name = word[0] if word else b""
        if name.startswith(b"SFT"):
            self.shifted = name == b"SFTON"
        if name in _LOOPS:
            self.run.close()
            self.trail.loop(_LOOPS[name])
        elif _ANY_MOVE.match(text) or (text and not _QUIET.match(text)):
            self.run.close()
            self.trail.lose()

    def _move(self, line: int, text: bytes, move: re.Match[bytes]) -> None:
        number = int(move[3]) + (P_POINTS if move[2] == b"P" else 0)
        row, letter, tail = self.row.get(number, UNKNOWN), move[1], move[4]
        start = int(self.starts[line - 1])
        begin = self.data.index(text, start)
        obstacle = Obstacle.NONE
        if _PARTNER.search(tail):
            obstacle = Obstacle.EXTERNAL
        elif b"UNTIL" in tail or b"NWAIT" in tail:
            obstacle = Obstacle.EVENT
        elif not self.numbered or self.shifted:
            obstacle = Obstacle.FORM
        step = Step(
            row=row,
            line=line,
            begin=begin,
            target=begin + move.start(2),
            target_end=begin + move.end(3),
            end=begin + len(text),
            obstacle=obstacle,
        )
        if letter == b"C":
            self.run.add(step)
            if b"FPT" in tail:
                self.run.turn()
            return
        self.run.close()
        if letter == b"L":
            s = TrailStatement(0, begin, -1, -1, step.target, step.target_end, step.end)
            self.trail.move(UNKNOWN, row, line, s, obstacle)
        else:
            self.trail.arrive(row)


class _Writer:
    """Inserts targets into one job."""

    def __init__(self, program: Program, moves: Moves, insertion: Insertion) -> None:
        self.program, self.moves, self.insertion = program, moves, insertion
        self.data = program.data
        self.found: JbiScan = program.spans.scan
        self.eol = line_end(program.data)
        own = np.flatnonzero(self.found.names < P_POINTS)
        self.next = int(self.found.names[own].max(initial=-1)) + 1
        self.last = int(own[-1]) if len(own) else UNKNOWN
        self.points: list[bytes] = []
        if len(own):
            self.state = self.found.headers[int(self.found.header[self.last])]
            self.words = self._fields(self.last)

    def write(self) -> bytes:
        """Returns the bytes."""
        if not len(self.insertion):
            return self.data
        first = self.state, self.words
        edits = []
        for group in groups(self.moves, self.insertion):
            edits.append((group.statement.begin, 0, self._copies(group)))
        self.points += self._headers(*first)
        starts, line = line_starts(self.data), int(self.found.line[self.last])
        place = int(starts[line]) if line < len(starts) else len(self.data)
        edits.append((place, 0, b"".join(self.points)))
        count = _NPOS.search(self.data)
        if count:
            total = str(int(count[2]) + len(self.insertion)).encode()
            edits.append((count.start(2), len(count[2]), total))
        return put_in([self.program], [edits])[0]

    def _copies(self, group: MoveGroup) -> bytes:
        s = group.statement
        names = [self._point(model, row) for model, row in group.models(self.moves)]
        end = self._end(s.other) if s.other >= 0 else s.end
        copies = copy_statements(self.data, s, names, end)
        return b"".join(_STOP.sub(b"PL=1", copy) + self.eol for copy in copies)

    def _end(self, begin: int) -> int:
        """Returns where the instruction that begins at a byte ends."""
        match = re.compile(rb"[^\r\n']*").match(self.data, begin)
        return begin + len(match[0].rstrip()) if match else begin

    def _point(self, model: int, row: int) -> bytes:
        """Adds a point like another and returns its name."""
        number, self.next = self.next, self.next + 1
        if number > _MOST:
            raise ShapeError(f"C{number} is no C point: numbers end at {_MOST}.")
        name = b"C%05d" % number
        state = self.found.headers[int(self.found.header[model])]
        words = self._fields(model)
        given = self.insertion.words[row]
        if words is not None and len(given):
            told = np.where(given == NO_WORD, words[: WORDS["yaskawa"]], given).tolist()
            words = (*told, *words[WORDS["yaskawa"] :])
        self.points += self._headers(state, words)
        values = new_numbers(
            self.program, model, self.insertion.position[row], self.insertion.rotation[row]
        )
        self.points.append(name + b"=" + b",".join(values) + self.eol)
        return name

    def _fields(self, row: int) -> tuple[int, ...] | None:
        index = int(self.found.configuration[row])
        return None if index < 0 else self.found.rconf[index]

    def _headers(self, state: Header, words: tuple[int, ...] | None) -> list[bytes]:
        """Returns the header lines that make a state hold, and remembers that it does."""
        lines = []
        if state.user and state.user != self.state.user:
            lines.append(f"///USER {state.user}")
        if state.tool and state.tool != self.state.tool:
            lines.append(f"///TOOL {state.tool}")
        if (state.postype, state.unit) != (self.state.postype, self.state.unit):
            unit = next(name for name, code in UNITS.items() if code == state.unit)
            lines += [f"///POSTYPE {state.postype}"] * bool(state.postype) + [f"///{unit}"]
        if words is not None and words != self.words:
            lines.append("///RCONF " + ",".join(map(str, words)))
            self.words = words
        self.state = state
        return [line.encode() + self.eol for line in lines]


INSERTER: Final = OneFileInserter(
    called="a Yaskawa job",
    read=lambda trail, program: _Reader(trail, program).read(),
    written=lambda program, moves, insertion: _Writer(program, moves, insertion).write(),
)
