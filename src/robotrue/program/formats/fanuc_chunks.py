"""Long Fanuc LS programs: plain moves, and records of group 1 alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.program.formats.fanuc_moves import MOTION, PLAIN_MOVE
from robotrue.program.formats.fanuc_offsets import doubtful_words, in_another_language
from robotrue.program.formats.fanuc_scan import PLAIN_RECORD, RECORD_END, RECORD_HEAD, STATEMENT
from robotrue.program.formats.fanuc_write import FanucSpans, read_config
from robotrue.program.formats.numbered_chunks import (
    MOVES,
    OTHER,
    POINTS,
    NumberedCutter,
    NumberedSurvey,
    Part,
    find_line,
)
from robotrue.program.program import Motion, Program

_MN, _POS, _END = (re.compile(rb"/%b\b[^\n]*\n?" % word) for word in (b"MN", b"POS", b"END"))
_LINE: Final = 512
"""Bytes; a longer line of blanks does not end a window."""
_NAMED: Final = re.compile(rb"P\s*+\[\s*+(\d{1,6})(?!\d)")
_SHIFT: Final = re.compile(rb"\b(?:TOUCH|MP)[ \t]+OFFSET\b", re.IGNORECASE)
_LETTER: Final = {motion: letter for letter, motion in MOTION.items()}


class FanucSurvey(NumberedSurvey):
    """Two passes over an LS file."""

    sections = ((_MN, MOVES, 4, (1,)), (_POS, POINTS, 2, (6,)), (_END, OTHER, 0, ()))

    def _begin(self) -> None:
        super()._begin()
        self._states: dict[tuple[bytes, ...], int] = {}
        self._tails: dict[bytes, bool] = {}

    def _find_end(self, data: bytes) -> int:
        """Statements and records end with a semicolon."""
        cut = super()._find_end(data)
        while cut and data[max(cut - _LINE, 0) : cut].rstrip()[-1:] != b";":
            cut = data.rfind(b"\n", 0, cut - 1) + 1
        return cut

    def _match_plain(self, data: bytes, at: int, end: int) -> tuple[re.Match[bytes], Part] | None:
        if self.kind == MOVES:
            move = PLAIN_MOVE.match(data, at, end)
            if move is None:
                return None
            if move[5] not in self._tails:
                self._tails[move[5]] = not doubtful_words(move[5])
            return (move, Part(MOTION[move[3]])) if self._tails[move[5]] else None
        record = PLAIN_RECORD.match(data, at, end)
        if record is None or (record[5] and record[5].strip() and not read_config(record[5])):
            return None
        state = self._states.setdefault(record.group(3, 4), len(self._states))
        return record, Part(state, is_point=True, opens=True)

    def _match_other(self, data: bytes, at: int, end: int) -> tuple[int, Part | None]:
        if self.kind == MOVES:
            statement = STATEMENT.match(data, at, end)
            after = statement.end() if statement else end
            names = [int(number) for number in _NAMED.findall(data, at, after)]
            return after, Part(names=np.array(names, np.int64))
        head = RECORD_HEAD.match(data, at, end)
        close = RECORD_END.search(data, head.end(), end) if head else None
        names = [int(head[1])] if head else []
        part = Part(names=np.array(names, np.int64), is_point=head is not None)
        after = close.end() if close else end
        return after, part if data[at:after].strip() else None

    def _find_fault(self, skeleton: Program) -> str:
        scan = skeleton.spans.scan
        if len(skeleton.spans.written):
            return "a move whose target gets a separate position"
        if _SHIFT.search(skeleton.data, *scan.statements):
            return "Touch Offset or MP OFFSET moves the targets after it"
        if in_another_language(skeleton.data, scan.statements):
            return "a listing in another language than English"
        return ""


def _add_moves(
    head: bytes, foot: bytes, names: Sequence[int], motion: Motion
) -> tuple[bytes, bytes]:
    begin, _ = find_line(_POS, head, 0) or (0, 0)
    move = _LETTER[motion] + b" P[%d] ;\n"
    moves = b"".join(move % name for name in names)
    return head[:begin] + moves + head[begin:], foot


def _take(spans: FanucSpans, rows: slice) -> FanucSpans:
    scan = replace(spans.scan, place=spans.scan.place[rows], config=spans.scan.config[rows])
    return replace(spans, tokens=spans.tokens.take(rows), scan=scan)


CUTTER: Final = NumberedCutter(survey=FanucSurvey, add_moves=_add_moves, take=_take)
