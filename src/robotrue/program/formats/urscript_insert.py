"""Inserts targets into UR scripts: movel, movep and movec with literal poses or variables.

An insertion is a separate line before the move, a copy of it with the new pose written out. The
robot stops at a move without a blend radius, so that the copies get one: that of the move, at most
0.4 of the shorter adjacent part, 1 mm where the move has none or 0. A move whose own blend would
reach beyond half of its last part is refused: the controller would skip a blend.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    Literals,
    Trail,
    TrailStatement,
    indentation,
    line_end,
    pose_in,
    repeat_statement,
)
from robotrue.program.formats.number_text import NUMBER, WHOLE_NUMBER, Stretch, respell_literal
from robotrue.program.formats.statement_insert import MoveCopy, StatementInserter
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.formats.urscript_scan import POSE, arguments, blank_comments, routines
from robotrue.program.formats.urscript_write import nearest_rotation_vector
from robotrue.program.insertion import Obstacle
from robotrue.program.program import Program

_MOVE: Final = re.compile(rb"\s*(move[lpjc])\s*\(")
_GIVEN: Final = re.compile(rb"(?<![\w.])([A-Za-z_]\w*+)\s*+=(?!=)\s*+(p\[)?")
_NAME: Final = re.compile(rb"[A-Za-z_]\w*$")
_KEYWORD: Final = re.compile(rb"\s*(while|if|elif|else|return|break|end|run|halt|def|thread)\b")
_CALLED: Final = re.compile(rb"(?<!\w)\d*+([A-Za-z_]\w*+)\s*+\(")
_PLAIN: Final = re.compile(
    rb"[ \t]*+(move[lp])[ \t]*+\([ \t]*+(" + POSE.pattern + rb")(,?[^()\[\]\r\n]*+)\)[ \t]*+$"
)
"""A move to a pose written out and nothing else on its line."""
_TAILS: Final = 4096
_NAMED: Final = re.compile(rb"\s*(?:pose|pose_via|pose_to|q)\s*=\s*")
_QUIET: Final = re.compile(
    rb"set_|get_|write_|read_|textmsg$|sleep$|popup$|sync$|modbus|pose_|rpc|to_str|d2r$|r2d$|norm$|"
    rb"sqrt$|sin$|cos$|request_|length$|is_|interpolate_pose$|point_dist$"
)
_RADIUS: Final = {b"movel": 4, b"movep": 3, b"movec": 4}
"""Place of r among the arguments; t is before it in movel."""
_OWN: Final = 0.001
"""m, where the move has no blend."""
_SHARE: Final = 0.4
_LEAST: Final = 7


def _read_job(trail: Trail, job: Sequence[Program]) -> None:
    literals = _literals(job)
    for file, program in enumerate(job):
        _Reader(trail, literals, file, program).read()


def _copy_move(copy: MoveCopy) -> list[Stretch]:
    """Returns the lines inserted before a move; refuses a blend beyond half of a part."""
    s, data, insertion = copy.statement, copy.data, copy.insertion
    texts = [
        _retarget(_literal(program, own), *pose_in(insertion, row))
        for program, own, row in copy.models
    ]
    behind = line_end(data) + indentation(data, s.begin)
    tail = _blend(data, s, _shortest_part(copy), copy.program.name, copy.line)
    new = b"".join(text + behind for text in repeat_statement(data, s, texts, tail))
    return [(s.begin, 0, new)]


def _literals(job: Sequence[Program]) -> Literals:
    return Literals([program.spans.numbers.start[:, 0] for program in job])


def _shortest_part(copy: MoveCopy) -> float:
    """Returns the length in m of the shortest part of a move, along chords."""
    rows = list(copy.rows)[1::2] if copy.statement.via >= 0 else list(copy.rows)
    ends = [program.position[row] for program, row in (copy.own_start, copy.own_end)]
    points = np.array([ends[0], *copy.insertion.position[rows], ends[1]])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).min())


class _Reader:
    """Goes over the routines of one script."""

    def __init__(self, trail: Trail, literals: Literals, file: int, program: Program) -> None:
        self.trail, self.literals, self.file, self.program = trail, literals, file, program
        self.code = blank_comments(program.data)
        self.lines: list[int] = line_starts(program.data).tolist()
        self.given: dict[bytes, list[int]] = defaultdict(list)
        self.tails: dict[tuple[bytes, bytes], Obstacle] = {}
        for match in _GIVEN.finditer(self.code):
            begin = match.start(2) if match[2] else match.end()
            pose = POSE.match(self.code, begin) if match[2] else None
            row = literals.row(file, *pose.span()) if pose else UNKNOWN
            self.given[match[1]].append(row)

    def read(self) -> None:
        """Reads every routine."""
        for routine in routines(self.code, self.program.name):
            self.trail.routine()
            blocks: list[bytes] = []
            for start, end in routine.statements:
                self._statement(start, end, blocks)

    def _statement(self, start: int, end: int, blocks: list[bytes]) -> None:
        if self._plain(start, end):
            return
        move = _MOVE.match(self.code, start, end)
        if move is not None:
            self._move(move, start, end)
            return
        keyword = _KEYWORD.match(self.code, start, end)
        if keyword is not None:
            self._control(keyword[1], blocks)
        elif any(not _QUIET.match(name) for name in _CALLED.findall(self.code, start, end)):
            self.trail.lose()

    def _control(self, word: bytes, blocks: list[bytes]) -> None:
        if word in (b"while", b"if"):
            blocks.append(word)
        ended = blocks.pop() if word == b"end" and blocks else b""
        if b"while" in (word, ended):
            self.trail.loop(1 if word == b"while" else -1)
        else:
            self.trail.lose()

    def _plain(self, start: int, end: int) -> bool:
        """Takes a move to a pose written out; scripts end nearly all of them in a few ways."""
        match = _PLAIN.match(self.code, start, end)
        if match is None:
            return False
        key = match[1], match[3]
        obstacle = self.tails.get(key)
        if obstacle is None:
            places = arguments(self.code, match.end(2), match.end(3))[1:]
            obstacle = self._obstacle(match[1], places, 1)
            if len(self.tails) < _TAILS:
                self.tails[key] = obstacle
        begin = match.start(1)
        line = bisect_right(self.lines, begin)
        s = TrailStatement(self.file, begin, -1, -1, *match.span(2), match.end(3) + 1)
        self.trail.move(UNKNOWN, self.literals.row(self.file, *match.span(2)), line, s, obstacle)
        return True

    def _move(self, move: re.Match[bytes], start: int, end: int) -> None:
        word = move[1]
        close = self.code.rfind(b")", move.end(), end)
        places = arguments(self.code, move.end(), max(close, move.end()))
        count = 2 if word == b"movec" else 1
        found = [self._target(*place) for place in places[:count]]
        if word == b"movej" or len(found) < count:
            self.trail.arrive(found[0][0] if word == b"movej" and found else UNKNOWN)
            return
        obstacle = self._obstacle(word, places[count:], count)
        auxiliary = found[0][1] if count == 2 else (UNKNOWN, UNKNOWN)
        begin = move.start(1)
        line = bisect_right(self.lines, begin)
        statement = TrailStatement(self.file, begin, *auxiliary, *found[-1][1], close + 1)
        self.trail.move(
            found[0][0] if count == 2 else UNKNOWN, found[-1][0], line, statement, obstacle
        )

    def _obstacle(self, word: bytes, places: list[tuple[int, int]], count: int) -> Obstacle:
        """What of the arguments after the targets keeps the move whole."""
        for number, (a, b) in enumerate(places, count):
            name, equals, value = self.code[a:b].partition(b"=")
            timed = name.strip() == b"t" if equals else word == b"movel" and number == 3
            text = value if equals else name
            if timed and not _zero(text):
                return Obstacle.TIMED
            radius = name.strip() == b"r" if equals else number == _RADIUS[word]
            if radius and not re.fullmatch(rb"\s*(?:" + NUMBER + rb"|\w+)\s*", text):
                return Obstacle.FORM
        return Obstacle.NONE

    def _target(self, begin: int, end: int) -> tuple[int, tuple[int, int]]:
        """Returns the row of a target and the bytes that are replaced by a new pose."""
        named = _NAMED.match(self.code, begin, end)
        begin = named.end() if named else begin
        text = self.code[begin:end]
        if _NAME.match(text):
            known = self.given.get(text, [])
            return (known[0] if len(known) == 1 else UNKNOWN), (begin, end)
        spans = [each.span() for each in POSE.finditer(self.code, begin, end)]
        for span in reversed(spans):  # the frame of pose_trans comes before the pose
            row = self.literals.row(self.file, *span)
            if row >= 0:
                return row, span
        return UNKNOWN, (begin, end)


def _zero(text: bytes) -> bool:
    match = re.fullmatch(rb"\s*(" + NUMBER + rb")\s*", text)
    return match is not None and float(match[1]) == 0.0


def _blend(data: bytes, s: TrailStatement, part: float, name: str, line: int) -> bytes:
    """Returns the text after the target of a copy: the original, with a blend that fits."""
    tail = data[s.target_end : s.end]
    code = blank_comments(tail)
    # The target may be inside further brackets; their closing comes first.
    depth, at = code.count(b")") - code.count(b"(") - 1, 0
    for _ in range(depth):
        at = code.index(b")", at) + 1
    places = arguments(code, at, len(code) - 1)[1:]
    count = 2 if s.via >= 0 else 1
    word = data[s.begin : s.begin + 5]
    for number, (a, b) in enumerate(places, count):
        key, equals, value = code[a:b].partition(b"=")
        if key.strip() == b"r" if equals else number == _RADIUS[word]:
            text = (value if equals else key).strip()
            if re.fullmatch(NUMBER, text):
                own = float(text)
                if own > 0.5 * part:
                    raise ConfigurationError(
                        f"the blend of {own * 1e3:g} mm reaches beyond half of a part of "
                        f"{part * 1e3:.1f} mm.",
                        source=name,
                        line=line,
                        hint="a larger tolerance of splitting, or a smaller blend.",
                    )
                radius = b"%.5f" % min(own or _OWN, _SHARE * part)
            else:
                radius = text  # a variable: it is the post's blend for all moves
            begin = b - len(code[a:b]) + code[a:b].rindex(text)
            return tail[:begin] + radius + tail[begin + len(text) :]
    return tail[:-1] + b", r=%.5f)" % min(_OWN, _SHARE * part)


def _literal(program: Program, row: int) -> bytes:
    at = int(program.spans.numbers.start[row, 0])
    begin = program.data.rfind(b"p", 0, program.data.rfind(b"[", 0, at))
    match = POSE.match(program.data, begin)
    return re.sub(rb"\s*[\r\n]\s*", b" ", match[0]) if match else b""


def _retarget(literal: bytes, position: Array, rotation: Array) -> bytes:
    """Returns ``p[..]`` with another pose."""
    printed = np.array([float(token) for token in re.findall(WHOLE_NUMBER, literal)])
    vector = nearest_rotation_vector(rotation[None], printed[None, 3:])[0]
    return respell_literal(literal, [*position, *vector], [_LEAST] * 6)


INSERTER: Final = StatementInserter(read=_read_job, copy=_copy_move)
