"""Inserts targets into Fanuc LS programs: L, C and runs of A.

New positions are numbered on from the last and follow it in ``/POS``; a copy of the move names
each. The numbers of later lines and ``LINE_COUNT`` count on. ``FINE`` becomes ``CNT100`` in the
copies: at ``FINE`` the robot stops, at ``CNT100`` it keeps its speed, and where two parts of a line
meet there is no corner to cut.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.errors import ShapeError
from robotrue.program.formats.fanuc_scan import STATEMENT, FanucScan, list_statements
from robotrue.program.formats.fanuc_write import MOST, behind_records, config_edits, copy_record
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    MoveGroup,
    Trail,
    TrailStatement,
    groups,
    line_start,
    put_in,
)
from robotrue.program.formats.number_text import Stretch
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

_MOVE: Final = re.compile(rb"[ \t]*([JLCAS])[ \t]+(P|PR)\s*\[", re.DOTALL)
_TARGET: Final = re.compile(rb"\bP\s*+\[\s*+(\d{1,6})\s*+(?::(?:(?!\bP\s*\[)[^\]])*+)?\]")
_TIMED: Final = re.compile(rb"\d\s*m?sec\b(?!\w)|\bR\[[^\[\]]*+\]\s*+m?sec", re.IGNORECASE)
_PER_SECOND: Final = re.compile(rb"(?:mm|inch|cm|deg)\s*/\s*m?(?:sec|in)", re.IGNORECASE)
_TIED: Final = re.compile(rb"\b(?:TA|TB|DB|DA|Skip|SKIP|POINT_LOGIC|PTH_PLN)\b|\bCALL\b")
_FINE: Final = re.compile(rb"\bFINE\b")
_QUIET: Final = re.compile(
    rb"\s*(?:!|//|--|(?:DO|RO|GO|AO|SO|UO|F|M|R|SR|TIMER|UFRAME|UTOOL|\$[\w.]*)\s*\[[^\]]*\][\w.$]*\s*=|"
    rb"\$[\w.\[\]]+\s*=|UFRAME_NUM|UTOOL_NUM|WAIT\b|PAYLOAD|MESSAGE|OVERRIDE|COL |UALM|TIMER|"
    rb"(?:DO|RO)\[[^\]]*\]=PULSE|\s*$)"
)
_LOOPS: Final = ((re.compile(rb"\s*FOR\b"), 1), (re.compile(rb"\s*ENDFOR\b"), -1))
_HEAD: Final = re.compile(rb"\A[ \t]*(\d+)[ \t]*:")
_COUNT: Final = re.compile(rb"(LINE_COUNT\s*=\s*)(\d+)")


class _Reader:
    """Goes over the statements of a program."""

    def __init__(self, trail: Trail, program: Program) -> None:
        self.trail, self.data, self.run = trail, program.data, Run(trail)
        self.found: FanucScan = program.spans.scan
        self.row = {number: row for row, number in enumerate(self.found.number.tolist())}
        self.lines = line_starts(program.data)
        self.written = {first for each in program.spans.written for first, _ in each.spans}

    def read(self) -> None:
        """Reads every statement."""
        self.trail.routine()
        for match in list_statements(self.data, *self.found.statements):
            self._statement(match)
        self.run.close()

    def _statement(self, match: re.Match[bytes]) -> None:
        begin, end = match.span(2)
        move = _MOVE.match(self.data, begin, end)
        if move is not None:
            self._move(match, move[1])
            return
        text = match[2]
        for pattern, step in _LOOPS:
            if pattern.match(text):
                self.run.close()
                self.trail.loop(step)
                return
        if not _QUIET.match(text):
            self.run.close()
            self.trail.lose()

    def _move(self, match: re.Match[bytes], letter: bytes) -> None:
        begin, end = match.span(2)
        count = 2 if letter == b"C" else 1
        targets = list(_TARGET.finditer(self.data, begin, end))[:count]
        if len(targets) < count or self.written & {each.start() for each in targets}:
            self.run.close()
            self.trail.lose()
            return
        rows = [self.row.get(int(each[1]), UNKNOWN) for each in targets]
        line = int(np.searchsorted(self.lines, targets[0].start(), side="right"))
        obstacle = self._obstacle(self.data[targets[-1].end() : end])
        first, last = targets[0], targets[-1]
        start = line_start(self.data, first.start())
        if letter == b"A":
            step = Step(
                row=rows[0],
                line=line,
                begin=start,
                target=first.start(),
                target_end=first.end(),
                end=match.end(),
                obstacle=obstacle,
            )
            self.run.add(step)
            return
        self.run.close()
        if letter in (b"L", b"C"):
            via = first.span() if letter == b"C" else (UNKNOWN, UNKNOWN)
            s = TrailStatement(0, start, *via, *last.span(), match.end())
            auxiliary = rows[0] if letter == b"C" else UNKNOWN
            self.trail.move(auxiliary, rows[-1], line, s, obstacle)
        else:
            self.trail.arrive(rows[0])

    def _obstacle(self, tail: bytes) -> Obstacle:
        if _TIMED.search(_PER_SECOND.sub(b"", tail)):
            return Obstacle.TIMED
        if _TIED.search(tail):
            return Obstacle.EVENT
        return Obstacle.NONE


class _Writer:
    """Inserts targets into one program."""

    def __init__(self, program: Program, moves: Moves, insertion: Insertion) -> None:
        self.program, self.moves, self.insertion = program, moves, insertion
        self.data = program.data
        self.found: FanucScan = program.spans.scan
        self.next = self.found.highest + 1
        self.records: list[bytes] = []

    def write(self) -> bytes:
        """Returns the bytes."""
        if not len(self.insertion):
            return self.data
        edits: list[Stretch] = []
        places: list[tuple[int, int]] = []  # place, number of inserted statements
        for group in groups(self.moves, self.insertion):
            copies = self._number_copies(self._copies(group), sum(n for _, n in places))
            edits.append((group.statement.begin, 0, b"".join(copies)))
            places.append((group.statement.begin, len(copies)))
        edits += self._renumber_lines(places)
        behind = behind_records(self.data, self.found.last_record)
        edits.append((behind, 0, b"".join(self.records)))
        count = _COUNT.search(self.data, 0, self.found.statements[0])
        if count:
            total = str(int(count[2]) + sum(n for _, n in places)).encode()
            edits.append((count.start(2), len(count[2]), total))
        return put_in([self.program], [edits])[0]

    def _copies(self, group: MoveGroup) -> list[bytes]:
        """Returns the inserted statements, numbered from their place."""
        s, data = group.statement, self.data
        names = [self._position(model, row) for model, row in group.models(self.moves)]
        match = STATEMENT.match(data, s.other) if s.other >= 0 else None
        copies = copy_statements(data, s, names, match.end() if match else s.target_end)
        return [_FINE.sub(b"CNT100", copy) for copy in copies]

    def _number_copies(self, copies: list[bytes], more: int) -> list[bytes]:
        """Returns the copies with line numbers that count on from that of the first."""
        head = _HEAD.match(copies[0])
        if head is None:
            return copies
        first = int(head[1]) + more
        return [_HEAD.sub(_label(first + k, len(head[0])), text) for k, text in enumerate(copies)]

    def _position(self, model: int, row: int) -> bytes:
        """Adds a record like another and returns its name."""
        number, self.next = self.next, self.next + 1
        if number > MOST:
            raise ShapeError(f"P[{number}] is no position: numbers end at {MOST}.")
        tokens = self.program.spans.tokens
        values = new_numbers(
            self.program, model, self.insertion.position[row], self.insertion.rotation[row]
        )
        starts, sizes = tokens.start[model].tolist(), tokens.length[model].tolist()
        edits = [*zip(starts, sizes, values, strict=True)]
        words = self.insertion.words[row].tolist()
        edits += config_edits(self.data, self.found.config[model].tolist(), words)
        place = int(self.found.place[model])
        self.records.append(copy_record(self.data, place, starts[5], number, edits))
        return b"P[%d]" % number

    def _renumber_lines(self, places: list[tuple[int, int]]) -> list[Stretch]:
        """Returns the new numbers of the lines after the first inserted statement."""
        out, k, more = [], 0, 0
        for match in list_statements(self.data, *self.found.statements):
            while k < len(places) and places[k][0] <= match.start(2):
                more += places[k][1]
                k += 1
            if match[1] and more:
                text = str(int(match[1]) + more).encode()
                first, size = match.start(1), len(match[1])
                blanks = 0
                while blanks < len(text) - size and self.data[first - 1 : first] == b" ":
                    first, size, blanks = first - 1, size + 1, blanks + 1
                out.append((first, size, text))
        return out


def _label(number: int, width: int) -> bytes:
    """Returns a line number with its colon, as wide as others if it can be."""
    return str(number).encode().rjust(width - 1) + b":"


INSERTER: Final = OneFileInserter(
    called="a Fanuc program",
    read=lambda trail, program: _Reader(trail, program).read(),
    written=lambda program, moves, insertion: _Writer(program, moves, insertion).write(),
)
