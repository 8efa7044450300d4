"""Inserts targets into KRL programs: LIN and CIRC with points in braces or stored ones.

An insertion is a separate line before the move, a copy of it with the numbers of the new target in
braces, also where the move names a stored point: names, declarations in the ``.dat`` and array
bounds stay as they are. Without an approximation word the copies get ``C_DIS``: a KUKA stops
exactly at a point without one. The approximation distance is ``$APO.CDIS``, at most half of the
move.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.formats.krl_write import KrlSpans
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    Trail,
    TrailStatement,
    line_end,
    pose_in,
    repeat_statement,
)
from robotrue.program.formats.number_text import Stretch, restyle
from robotrue.program.formats.statement_insert import MoveCopy, StatementInserter
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Obstacle, job_rows
from robotrue.program.program import Program

_PLAIN: Final = re.compile(
    rb"(?:[ \t]*+S?LIN[ \t]*+\{[^{}\r\n;]*+\}[ \t]*+(?:C_\w++[ \t]*+)*+(?:\r\n|\n))++",
    re.IGNORECASE,
)
"""Lines of LIN to a point in braces and nothing else, as CAM writes them by the million."""
_LINE: Final = re.compile(rb"([^\r\n]*)(?:\r\n|\n|\r|\Z)")
_CODE: Final = re.compile(rb'(?:[^;"]|"[^"]*"?)*+')
_POINT: Final = rb"(\{[^{}]*\}|[A-Za-z_]\w*(?:\s*\[[^\]]*\])?)"
_MOTION: Final = re.compile(rb"\s*S?(PTP|LIN|CIRC|SPL)(_REL)?(?!\w)\s*(?![=(\[.])", re.IGNORECASE)
_OPERANDS: Final = {
    1: re.compile(_POINT + rb"(?=\s|$)"),
    2: re.compile(_POINT + rb"\s*,\s*" + _POINT + rb"(?=\s|$)"),
}
_TAIL: Final = re.compile(rb"(?:\s*+C_\w++)*+\s*+(?:WITH\s.*)?$", re.IGNORECASE | re.DOTALL)
_SMOOTH: Final = re.compile(rb"\bC_\w+", re.IGNORECASE)
_STORED: Final = re.compile(
    rb"^[ \t]*+(?:(?:GLOBAL|DECL|CONST)[ \t]++)*+(?:[A-Za-z_]\w*+[ \t]++)?"
    rb"([A-Za-z_]\w*+[ \t]*+(?:\[[^\]\r\n]*\])?)[ \t]*+=[ \t]*+(\{[^{}\r\n]*\})",
    re.IGNORECASE | re.MULTILINE,
)
_WORD: Final = re.compile(rb"\s*(\$?\w+)")
_CALL: Final = re.compile(rb"(?<![\w$])(?!BAS\b)[A-Za-z_]\w*\s*\(", re.IGNORECASE)
_COMPONENT: Final = re.compile(rb"(?<![\w'])([A-Za-z]\w*)\s+([+-]?[\d.][\d.]*(?:\s*[eE][+-]?\d+)?)")
_LOOPS: Final = {b"for": 1, b"while": 1, b"loop": 1, b"repeat": 1,
                 b"endfor": -1, b"endwhile": -1, b"endloop": -1, b"until": -1}  # fmt: skip
_TURNS: Final = frozenset(
    b"if else endif switch case default endswitch goto return exit resume end endfct".split()
)
_QUIET: Final = frozenset(
    b"decl bas wait halt int real bool char signal ext extfct import pulse continue interrupt "
    b"global struc enum anin anout digin confirm".split()
)
_LEAST: Final = 4
_POSE: Final = (b"X", b"Y", b"Z", b"A", b"B", b"C")


def _read_job(trail: Trail, job: Sequence[Program]) -> None:
    """Reads the moves of a job, those of its first file first."""
    stored, first = _find_stored(job), job_rows(job)
    for file, program in enumerate(job):
        own = _of_stem(job, first, PurePath(program.name).stem)
        _Reader(trail, stored, file, program, int(first[file]), own).read()


def _copy_move(copy: MoveCopy) -> list[Stretch]:
    """Returns the lines inserted before a move, and its target with its omitted numbers."""
    data, insertion = copy.data, copy.insertion
    s = _whole(data, copy.statement)
    texts = []
    for k, (program, own, row) in enumerate(copy.models):
        literal = _find_literal(program, own)
        bare = s.via >= 0 and k % 2 == 0
        texts.append(_aggregate(literal, *pose_in(insertion, row), bare=bare))
    lines = [_smooth(each) + line_end(data) for each in repeat_statement(data, s, texts)]
    edits = [(s.begin, 0, b"".join(lines))]
    literal = data[s.target : s.target_end]
    if literal[:1] == b"{":  # omitted numbers would be inherited from the inserted target
        program, row = copy.own_end
        whole = _complete(literal, program.position[row], program.rotation[row])
        if whole != literal:
            edits.append((s.target, len(literal), whole))
    return edits


def _whole(data: bytes, statement: TrailStatement) -> TrailStatement:
    """Returns the statement of a plain line with the place of its target."""
    if statement.target >= 0:
        return statement
    line = _LINE.match(data, statement.begin)
    code = _CODE.match(data, *line.span(1)) if line else None
    end = code.end() if code else len(data)
    target, last = data.find(b"{", statement.begin, end), data.find(b"}", statement.begin, end) + 1
    end -= len(data[last:end]) - len(data[last:end].rstrip())
    return statement._replace(target=target, target_end=last, end=end)


class _Reader:
    """Goes over the lines of one file."""

    def __init__(
        self,
        trail: Trail,
        stored: dict[bytes, list[int]],
        file: int,
        program: Program,
        first: int,
        own: list[range],
    ) -> None:
        self.trail, self.stored, self.file, self.first = trail, stored, file, first
        self.program, self.starts = program, line_starts(program.data)
        self.data, self.lines = program.data, program.line.tolist()
        self.next, self.spline, self.own = 0, False, own
        spans = program.spans
        self.written = set(spans.written.start.tolist()) if isinstance(spans, KrlSpans) else set()

    def read(self) -> None:
        """Reads every line."""
        self.trail.routine()
        data, at, number = self.data, 0, 1
        while at < len(data):
            run = None if self.spline else _PLAIN.match(data, at)
            if run is not None:
                count = data.count(b"\n", at, run.end())
                if self._run(number, count):
                    at, number = run.end(), number + count
                    continue
            match = _LINE.match(data, at)
            if match is None:
                return
            found = _CODE.match(data, *match.span(1))
            end = found.end() if found else match.end(1)
            if end > at:
                self._line(number, at, end)
            at, number = match.end(), number + 1

    def _run(self, number: int, count: int) -> bool:
        """Takes a run of plain lines; False where they are not one target each."""
        first = self._advance(number)
        lines = self.program.line[first : first + count]
        if not np.array_equal(lines, number + np.arange(count)):
            return False
        if first + count < len(self.lines) and self.lines[first + count] < number + count:
            return False
        begins = self.starts[number - 1 : number - 1 + count]
        rows = range(self.first + first, self.first + first + count)
        self.trail.run(rows, number, self.file, begins)
        self.next = first + count
        return True

    def _advance(self, number: int) -> int:
        """Returns the first row of the file in a line or after it."""
        while self.next < len(self.lines) and self.lines[self.next] < number:
            self.next += 1
        return self.next

    def _line(self, number: int, begin: int, end: int) -> None:
        motion = _MOTION.match(self.data, begin, end)
        if motion is not None:
            self._motion(number, begin, end, motion)
            return
        word = _WORD.match(self.data, begin, end)
        if word is None:
            return
        name = word[1].lower()
        if name in _LOOPS:
            self.trail.loop(_LOOPS[name])
        elif name in (b"spline", b"endspline"):
            self.spline = name == b"spline"
            self.trail.lose()
        elif name == b"trigger":
            self.trail.tie()
        elif name in (b"def", b"deffct", b"global", b"defdat") and b"(" in self.data[begin:end]:
            self.trail.routine()
        elif name in _TURNS or (name not in _QUIET and self._unclear(begin, end)):
            self.trail.lose()

    def _unclear(self, begin: int, end: int) -> bool:
        """True if a statement may move the robot: a call, or a jump label."""
        text = self.data[begin:end].strip()
        return text.endswith(b":") or _CALL.search(text) is not None

    def _motion(self, number: int, begin: int, end: int, motion: re.Match[bytes]) -> None:
        kind = motion[1].upper()
        found = _OPERANDS[2 if kind == b"CIRC" else 1].match(self.data, motion.end(), end)
        if found is None or motion[2]:
            self._inline(number)
            self.trail.lose()
            return
        inline = self._inline(number)
        rows = [
            self._row(found[i + 1], found.start(i + 1), inline) for i in range(len(found.groups()))
        ]
        via = rows[0] if len(rows) == 2 else UNKNOWN
        tail = self.data[found.end() : end].rstrip()
        if kind in (b"PTP", b"SPL"):
            self.trail.arrive(rows[-1])
            return
        obstacle = Obstacle.NONE
        if self.spline or not _TAIL.match(tail):
            obstacle = Obstacle.FORM
        spans = [found.span(i + 1) for i in range(len(rows))]
        auxiliary = spans[0] if len(rows) == 2 else (UNKNOWN, UNKNOWN)
        statement = TrailStatement(
            self.file, begin, *auxiliary, *spans[-1], found.end() + len(tail)
        )
        self.trail.move(via, rows[-1], number, statement, obstacle)

    def _inline(self, number: int) -> list[int]:
        """Returns the job rows in a line, in order."""
        self._advance(number)
        out = []
        while self.next < len(self.lines) and self.lines[self.next] == number:
            out.append(self.first + self.next)
            self.next += 1
        return out

    def _row(self, operand: bytes, start: int, inline: list[int]) -> int:
        if start in self.written:  # a stored target that is written out in its move
            inline[:1] = []
            return UNKNOWN
        if operand[:1] == b"{":
            return inline.pop(0) if inline else UNKNOWN
        known = self.stored.get(_name(operand), [])
        own = [
            row for row in known if any(row in each for each in self.own)
        ]  # a name refers first to the same program
        known = own or known
        return known[0] if len(known) == 1 else UNKNOWN


def _of_stem(job: Sequence[Program], first: IntArray, stem: str) -> list[range]:
    """Returns the job rows of the files of one name, whatever their suffix."""
    return [
        range(int(first[file]), int(first[file + 1]))
        for file, program in enumerate(job)
        if PurePath(program.name).stem.lower() == stem.lower()
    ]


def _name(text: bytes) -> bytes:
    return re.sub(rb"\s+", b"", text).lower()


def _find_stored(job: Sequence[Program]) -> dict[bytes, list[int]]:
    """Returns the job rows every stored point is given."""
    out: dict[bytes, list[int]] = defaultdict(list)
    first = job_rows(job)
    for file, program in enumerate(job):
        found = list(_STORED.finditer(program.data))
        places = np.array([match.start(1) for match in found], dtype=np.int64)
        lines = np.searchsorted(line_starts(program.data), places, side="right")
        rows = np.searchsorted(program.line, lines)
        for match, line, row in zip(found, lines.tolist(), rows.tolist(), strict=True):
            if row < len(program) and program.line[row] == line:
                out[_name(match[1])].append(int(first[file]) + row)
    return out


def _find_literal(program: Program, row: int) -> bytes:
    """Returns the braces that contain the numbers of a row."""
    data, start = program.data, program.spans.numbers.start[row]
    at = int(start[start >= 0].min())
    return data[data.rfind(b"{", 0, at) : data.find(b"}", at) + 1]


def _aggregate(literal: bytes, position: Array, rotation: Array, *, bare: bool) -> bytes:
    """Returns braces with the six numbers of a pose; ``bare``: angles only where printed before."""
    printed = {name.upper(): value for name, value in _COMPONENT.findall(literal)}
    near = None
    if all(name in printed for name in _POSE[3:]):
        near = np.array([float(printed[n].replace(b" ", b"")) for n in _POSE[3:]]) * DEG
    values = [*(position / MM).tolist(), *(abc_from_matrix(rotation, near=near) / DEG).tolist()]
    wanted = dict(zip(_POSE, values, strict=True))

    def new(match: re.Match[bytes]) -> bytes:
        name = match[1].upper()
        if name not in wanted:
            return match[0]
        head = match[0][: match.start(2) - match.start()]
        return head + restyle(match[2].replace(b" ", b""), wanted[name], least=_LEAST)

    out = _COMPONENT.sub(new, literal)
    angles = bare and not any(name in printed for name in _POSE[3:])
    return _append(out, {n: wanted[n] for n in _POSE if not (angles and n in _POSE[3:])})


def _complete(literal: bytes, position: Array, rotation: Array) -> bytes:
    """Returns braces with the numbers they leave out."""
    values = [*(position / MM).tolist(), *(abc_from_matrix(rotation) / DEG).tolist()]
    return _append(literal, dict(zip(_POSE, values, strict=True)))


def _append(literal: bytes, wanted: Mapping[bytes, float]) -> bytes:
    """Returns braces with those of some components after their own that they leave out."""
    printed = {name.upper() for name, _ in _COMPONENT.findall(literal)}
    missing = [name for name in wanted if name not in printed]
    added = b"".join(b",%s %.*f" % (name, _LEAST, wanted[name]) for name in missing)
    return literal[:-1] + added + b"}" if missing else literal


def _smooth(line: bytes) -> bytes:
    return line if _SMOOTH.search(line) else line + b" C_DIS"


INSERTER: Final = StatementInserter(read=_read_job, copy=_copy_move)
