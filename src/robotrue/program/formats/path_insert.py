"""Inserts points into paths of words: G-code of Sinumerik and Fanuc, APT and CL data, CSV.

An insertion is a separate block, statement or row before the move. An arc of a plane (G2, G3)
cannot follow a correction that leaves the plane; it becomes lines, its own block, too, and the next
block of an arc without its own G2 or G3 gets one. In G-code a new block holds the G0 or G1 and the
feed of the move, if the move has them, and all words of the point; the block of the move then
states all words of its point, so that none is inherited from the inserted point. A block with
any other word (M, S, T, another G) is not split: the copies would run before its switching. Whether
the control stops between blocks is set by G64, G61.1 and similar before them, for new and old
blocks.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.formats.gcode_arcs import ACROSS
from robotrue.program.formats.move_trail import (
    COLUMNS,
    UNKNOWN,
    Statements,
    TrailStatement,
    groups,
    line_end,
    put_in,
)
from robotrue.program.formats.number_text import WHOLE_NUMBER, Stretch, restyle, splice_texts
from robotrue.program.formats.path_words import PathWords, Turn, printed_angles
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Insertion, Moves, Obstacle
from robotrue.program.program import Motion, Program, Reason

_GCODE: Final = ("sinumerik", "fanuc_gcode")
_BLOCK: Final = re.compile(rb"[^;(\r\n]*")
_NUMBERED: Final = re.compile(rb"\s*/?\s*(?:N\d+)?\s*", re.IGNORECASE)
_DRIVE: Final = re.compile(rb"G0*[0-3](?![\d.])", re.IGNORECASE)
_CENTRE: Final = re.compile(
    rb"(?:CR\s*+=|[IJKR])\s*+(?:=\s*+)?(?:AC\s*+\(\s*+)?" + WHOLE_NUMBER + rb"(?:\s*\))?",
    re.IGNORECASE,
)
_MOVES: Final = re.compile(rb"G0*[0-3](?![\d.])|\bCIP\b|\bCT\b|\bINVCW\b", re.IGNORECASE)
_FEED: Final = re.compile(rb"F\s*+(?:=\s*+)?" + WHOLE_NUMBER, re.IGNORECASE)
_POINT: Final = re.compile(
    rb"(?:(?:[XYZIJK]|[ABC]3?)\s*+(?:=\s*+)?|STAT\s*+=\s*+|TU\s*+=\s*+)" + WHOLE_NUMBER,
    re.IGNORECASE,
)
_ONCE: Final = re.compile(rb"^[^\S\n]*+RAPID\b", re.IGNORECASE | re.MULTILINE)
_BETWEEN: Final = re.compile(
    rb"(?im)^[^\S\n]*+(?:N\d+\s*)?(?:GOTO[FBC]?\b|IF\b|WHILE\b|FOR\b|LOOP\b|REPEAT\b|M98|M99|CALL\b|[LO]\d)"
)
_PLAIN: Final = re.compile(
    rb"^(?:[ \t]*+(?:N\d++[ \t]*+)?(?:G0*[01][ \t]++)?"
    rb"(?:[XYZ][ \t]*+[+-]?[\d.]++[ \t]*+)++(?:[ABC]3?[ \t]*+=?[ \t]*+[+-]?[\d.]++[ \t]*+)*+"
    rb"(?:F[\d.]++[ \t]*+)?(?:\r\n|\n))++",
    re.MULTILINE,
)
"""Blocks that do nothing but move to a point, as CAM writes them by the million."""
_UNSEEN: Final = b"0.0000"
_LEAST: Final = (4, 7)
"""Decimals of lengths and angles, and of tool axes."""


class PathInserter:
    """See the module."""

    def moves(self, job: Sequence[Program]) -> Moves:
        """Returns the moves of the first program, from row to row."""
        tables, statements, first = [], [], 0
        for file, program in enumerate(job):
            reader = _Reader(file, program, first)
            tables.append(reader.moves())
            statements.append(reader.statements(tables[-1][:, 2] - first))
            first += len(program)
        start, via, end, line, obstacle, across = np.concatenate(tables).T
        return Moves(
            start=start,
            via=via,
            end=end,
            line=line,
            obstacle=obstacle,
            across=across,
            spans=Statements(table=np.concatenate(statements)),
        )

    def insert(
        self, job: Sequence[Program], moves: Moves, insertion: Insertion
    ) -> tuple[bytes, ...]:
        """Returns the bytes of every program with the points inserted.

        Raises:
            ShapeError: A move with an obstacle, or a value that cannot be written.
        """
        first = np.concatenate([[0], np.cumsum([len(program) for program in job])])
        edits: list[list[Stretch]] = [[] for _ in job]
        for group in groups(moves, insertion):
            s = group.statement
            program, row = job[s.file], int(moves.end[group.move] - first[s.file])
            lines = [
                _copy(program, row, s, insertion.position[k], insertion.rotation[k])
                for k in group.rows
            ]
            eol = line_end(program.data)
            edits[s.file].append((s.begin, 0, b"".join(line + eol for line in lines)))
            edits[s.file] += _complete_words(program, row)
            if moves.via[group.move] >= 0:
                edits[s.file] += _straighten(program, row, s)
        for file, program in enumerate(job):
            edits[file] += _resume_arcs(program, _arcs_of(moves, insertion, first, file))
        return tuple(put_in(job, edits))


def _arcs_of(moves: Moves, insertion: Insertion, first: IntArray, file: int) -> IntArray:
    """Returns the rows of one program that end arcs which become lines."""
    cut = np.unique(insertion.move)
    rows = moves.end[cut[moves.via[cut] >= 0]]
    return np.asarray(rows[(rows >= first[file]) & (rows < first[file + 1])] - first[file])


class _Reader:
    """Lists the moves of one program: each row is reached from the one before it."""

    def __init__(self, file: int, program: Program, first: int) -> None:
        self.file, self.program, self.first, self.data = file, program, first, program.data
        self.words: PathWords = program.spans
        starts = line_starts(program.data)
        line = np.asarray(program.line)
        self.begin: IntArray = starts[line - 1]
        if program.data.startswith(b"\xef\xbb\xbf"):
            self.begin = np.maximum(self.begin, 3)
        self.end: IntArray = np.append(starts, len(program.data))[line]

    def moves(self) -> IntArray:
        """Returns start, via, end, line, obstacle and plane of every move (k, 6), in order."""
        program, n = self.program, len(self.program)
        row = np.arange(n)
        arc = np.asarray(program.motion == Motion.ARC_END)
        good = np.asarray(program.reason == Reason.NONE)
        line = np.asarray(program.motion == Motion.LIN) & good
        before = row - np.where(arc, 2, 1)
        lost = np.zeros(n, dtype=np.bool_)
        if program.dialect in _GCODE:
            lost[self._behind(_BETWEEN)] = True
        # The via of an arc is in its block, so that a loss before it applies to both.
        lost[arc] |= lost[row[arc] - 1]
        sure = (before >= 0) & good[before] & good & ~lost
        start = np.where(sure, before, UNKNOWN)
        plane, obstacle = self._planes(), self._obstacles()
        obstacle[arc & (plane < 0)] = Obstacle.FORM
        obstacle = np.where(~sure & (obstacle == 0), int(Obstacle.START), obstacle)
        shift = np.where(start >= 0, self.first, 0)
        table = np.stack(
            [
                start + shift,
                np.where(arc, self.first + row - 1, UNKNOWN),
                self.first + row,
                np.asarray(program.line),
                obstacle,
                plane,
            ],
            axis=1,
        )
        return np.asarray(table[line | arc])

    def _planes(self) -> IntArray:
        """Returns the axis across the plane of each row (n,) that ends such an arc, else -1."""
        arcs, out = self.words.arcs, np.full(len(self.program), -1)
        if len(arcs):
            out[arcs.end] = ACROSS[arcs.plane][:, 2]
        return out

    def statements(self, rows: IntArray) -> IntArray:
        """Returns the statements (k, 8) of rows."""
        out = np.full((len(rows), COLUMNS), UNKNOWN)
        out[:, 0], out[:, 1] = self.file, self.begin[rows]
        out[:, 4] = out[:, 1]
        out[:, 5] = out[:, 6] = self.end[rows]
        return out

    def _behind(self, pattern: re.Pattern[bytes]) -> IntArray:
        """Returns the rows right after what a pattern finds."""
        places = np.array([match.start() for match in pattern.finditer(self.data)], dtype=np.int64)
        rows = np.searchsorted(self.begin, places)
        return np.asarray(rows[rows < len(self.begin)])

    def _obstacles(self) -> IntArray:
        """Returns what keeps each row (n,) from being split, lines taken for granted."""
        words, n = self.words, len(self.program)
        needed = np.asarray(np.arange(6) < np.where(words.turn == Turn.FIXED, 3, 6)[:, None])
        missing = (needed & (words.numbers.start < 0) & ~words.barred).any(axis=1)
        out = np.where(missing & (words.at < 0), int(Obstacle.FORM), int(Obstacle.NONE))
        if self.program.dialect == "apt":
            out[self._behind(_ONCE)] = Obstacle.EVENT
        if self.program.dialect in _GCODE:
            plain = np.zeros(n, dtype=np.bool_)
            for run in _PLAIN.finditer(self.data):
                first, last = np.searchsorted(self.begin, run.span())
                plain[first:last] = True
            for row in np.flatnonzero(~plain & (out == Obstacle.NONE)).tolist():
                if self._switches(int(self.begin[row]), int(self.end[row])):
                    out[row] = Obstacle.EVENT
        return np.asarray(out)

    def _switches(self, begin: int, end: int) -> bool:
        """True if a block does anything but move to a point."""
        block = _BLOCK.match(self.data, begin, end)
        text = block[0] if block else b""
        for pattern in (_NUMBERED, _CENTRE, _POINT, _FEED, _DRIVE):
            text = pattern.sub(b" ", text, count=1 if pattern is _NUMBERED else 0)
        return bool(text.strip())


def _width(words: PathWords, row: int) -> int:
    """Returns how many words a point has: three where the orientation is not in the program."""
    return 3 if words.turn[row] == Turn.FIXED else 6


def _values(program: Program, row: int, position: Array, rotation: Array) -> list[float]:
    """Returns the values of the words of a point, in the units of a row."""
    words: PathWords = program.spans
    out: list[float] = (position / words.unit[row]).tolist()
    if words.turn[row] == Turn.ANGLES:
        out += printed_angles(rotation[None], words.value[row : row + 1, 3:], words.rule)[
            0
        ].tolist()
    elif words.turn[row] == Turn.VECTOR:
        out += words.rule.axes_of(rotation[None])[0].tolist()
    return out


def _token(program: Program, row: int, column: int, value: float) -> bytes:
    words: PathWords = program.spans
    start, size = (int(each[row, column]) for each in (words.numbers.start, words.numbers.length))
    style = program.data[start : start + size] if start >= 0 else _UNSEEN
    vector = column >= 3 and words.turn[row] == Turn.VECTOR
    return restyle(style, value, least=_LEAST[int(vector)] + (1 if words.unit[row] > 2e-3 else 0))


def _copy(program: Program, row: int, s: TrailStatement, position: Array, rotation: Array) -> bytes:
    """Returns the line of a point like that of a row."""
    words: PathWords = program.spans
    values = _values(program, row, position, rotation)
    texts = [_token(program, row, k, value) for k, value in enumerate(values)]
    if program.dialect in _GCODE:
        block = _BLOCK.match(program.data, s.begin, s.end)
        text = block[0] if block else b""
        switch, feed = _DRIVE.search(text), _FEED.search(text)
        drive = b"G1" if _is_arc(program, row) else switch[0] if switch else b""
        names = words.names[int(words.turn[row])]
        point = [name + text for name, text in zip(names, texts, strict=False)]
        parts = [drive, *point, feed[0] if feed else b""]
        return (b" " if words.blank else b"").join(part for part in parts if part)
    if program.dialect == "apt":
        head = program.data[s.begin : int(words.numbers.start[row, 0])]
        return head + b",".join(texts)
    return _row(program.data[s.begin : s.end], words, row, s.begin, texts)


def _row(line: bytes, words: PathWords, row: int, begin: int, texts: list[bytes]) -> bytes:
    """Returns a line of a table with other numbers."""
    starts, sizes = (each[row].tolist() for each in (words.numbers.start, words.numbers.length))
    cells = zip(starts, sizes, texts, strict=False)
    new = splice_texts(line, [(start - begin, size, text) for start, size, text in cells])
    return new.rstrip(b"\r\n")


def _is_arc(program: Program, row: int) -> bool:
    return bool(program.motion[row] == Motion.ARC_END)


def _straighten(program: Program, row: int, s: TrailStatement) -> list[Stretch]:
    """Returns what makes the block of an arc one of a line: G1, and no centre or radius."""
    block = _BLOCK.match(program.data, s.begin, s.end)
    end = block.end() if block else s.end
    drive = _DRIVE.search(program.data, s.begin, end)
    number = _NUMBERED.match(program.data, s.begin, end)
    at = number.end() if number else s.begin
    gap = b" " if program.spans.blank else b""
    out = [(drive.start(), len(drive[0]), b"G1")] if drive else [(at, 0, b"G1" + gap)]
    arcs = program.spans.arcs
    starts = arcs.numbers.start[arcs.end == row].ravel()
    for match in _CENTRE.finditer(program.data, at, end):
        if any(match.start() <= start < match.end() for start in starts.tolist()):
            first = match.start() - (program.data[match.start() - 1 : match.start()] == b" ")
            out.append((first, match.end() - first, b""))
    return out


def _resume_arcs(program: Program, rows: IntArray) -> list[Stretch]:
    """Returns the G2 or G3 that arcs after those that became lines had left out."""
    if not len(rows):
        return []
    reader, out, gap = _Reader(0, program, 0), [], b" " if program.spans.blank else b""
    left = dict(zip(program.spans.arcs.end.tolist(), program.spans.arcs.left.tolist(), strict=True))
    for row in rows.tolist():
        after = row + 1
        if after >= len(program) or after + 1 in rows:
            continue
        begin, end = int(reader.begin[after]), int(reader.end[after])
        block = _BLOCK.match(program.data, begin, end)
        end = block.end() if block else end
        if not _MOVES.search(program.data, int(reader.end[row]), end):
            number = _NUMBERED.match(program.data, begin, end)
            place = number.end() if number else begin
            out.append((place, 0, (b"G3" if left.get(row) else b"G2") + gap))
    return out


def _complete_words(program: Program, row: int) -> list[Stretch]:
    """Returns the words that a row omits, to be written after its others."""
    words: PathWords = program.spans
    missing: IntArray = np.flatnonzero(
        (words.numbers.start[row, : _width(words, row)] < 0)
        & ~words.barred[row, : _width(words, row)]
    )
    if not len(missing):
        return []
    names = words.names[int(words.turn[row])]
    gap = b" " if words.blank else b""
    texts = [
        gap + names[k] + restyle(_UNSEEN, float(words.value[row, k]), least=6)
        for k in missing.tolist()
    ]
    return [(int(words.at[row]), 0, b"".join(texts))]


INSERTER: Final = PathInserter()
