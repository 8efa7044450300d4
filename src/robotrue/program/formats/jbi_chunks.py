"""Long Yaskawa jobs: plain moves to C points, and points of six numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.program.formats.jbi_moves import MOTION, names_no_point
from robotrue.program.formats.jbi_read import count_note
from robotrue.program.formats.jbi_scan import P_POINTS, PLAIN_MOVE, PLAIN_POINT
from robotrue.program.formats.jbi_write import JbiSpans
from robotrue.program.formats.numbered_chunks import (
    MOVES,
    POINTS,
    NumberedCutter,
    NumberedSurvey,
    Part,
    find_line,
)
from robotrue.program.program import Motion, Program

_POS, _INST = (re.compile(rb"//%b[ \t]*\r?\n" % word, re.IGNORECASE) for word in (b"POS", b"INST"))
_END: Final = re.compile(rb"^[ \t]*END[ \t]*\r?$", re.MULTILINE)
_LINE: Final = re.compile(rb"[^\n]*\n?")
_NAMED: Final = re.compile(rb"([CP])X?(\d{1,6})(?!\d)")
_POINT: Final = re.compile(rb"[ \t]*[CP]\d")
_ARGUMENTS: Final = re.compile(rb"^[ \t]*//ARGINFO", re.MULTILINE | re.IGNORECASE)
_SHIFT: Final = re.compile(rb"^[^'\r\n]*\bSFTON", re.MULTILINE)
_LETTER: Final = {Motion.PTP: b"J", Motion.LIN: b"L"}


class JbiSurvey(NumberedSurvey):
    """Two passes over a job."""

    sections = ((_POS, POINTS, 3, (4,)), (_INST, MOVES, 2, ()))

    def _begin(self) -> None:
        super()._begin()
        self._state, self._configured = 0, False
        self._tails: dict[bytes, bool] = {}

    def _match_plain(self, data: bytes, at: int, end: int) -> tuple[re.Match[bytes], Part] | None:
        if self.kind == MOVES:
            move = PLAIN_MOVE.match(data, at, end)
            if move is None or move[1] == b"C":
                return None
            if move[3] not in self._tails:
                self._tails[move[3]] = names_no_point(move[3].partition(b"'")[0])
            return (move, Part(MOTION[move[1]])) if self._tails[move[3]] else None
        point = PLAIN_POINT.match(data, at, end)
        if point is None:
            return None
        configured = point[1] is not None
        self._configured |= configured
        return point, Part(
            self._state, is_point=True, opens=configured or not self._configured,
            header=int(configured), first=P_POINTS * (point[2] == b"P"),
        )  # fmt: skip

    def _match_other(self, data: bytes, at: int, end: int) -> tuple[int, Part | None]:
        line = _LINE.match(data, at, end)
        after = line.end() if line else end
        text = data[at:after].strip()
        if not text or text.startswith(b"'"):
            return after, None
        self._state += 1
        self._configured |= text.upper().startswith(b"///RCONF")
        names = [int(n) + P_POINTS * (kind == b"P") for kind, n in _NAMED.findall(text)]
        is_point = self.kind == POINTS and _POINT.match(text) is not None
        return after, Part(is_point=is_point, names=np.array(names[: 1 if is_point else None], int))

    def _find_fault(self, skeleton: Program) -> str:
        points = find_line(_POS, skeleton.data, 0)
        if points and _ARGUMENTS.search(skeleton.data, points[1]):
            return "//ARGINFO after the begin of the points"
        return "SFTON shifts the moves after it" if _SHIFT.search(skeleton.data) else ""

    def notes(self, skeleton: Program) -> tuple[str, ...]:
        """Returns the notes on the file; that on the number of points counts all of them."""
        scan, held = skeleton.spans.scan, self._rank >= 0
        found = {**scan.found, "C": int(held[:P_POINTS].sum()), "P": int(held[P_POINTS:].sum())}
        own = count_note(self.name, scan.counts, found)
        return (*(note for note in skeleton.notes if "///NPOS" not in note), *own)


def _add_moves(
    head: bytes, foot: bytes, names: Sequence[int], motion: Motion
) -> tuple[bytes, bytes]:
    *_, last = _END.finditer(foot)
    move = b"MOV" + _LETTER[motion] + b" C%05d\n"
    moves = b"".join(move % name for name in names)
    return head, foot[: last.start()] + moves + foot[last.start() :]


def _take(spans: JbiSpans, rows: slice) -> JbiSpans:
    scan = replace(spans.scan, line=spans.scan.line[rows])
    return replace(spans, tokens=spans.tokens.take(rows), rconf=spans.rconf[rows], scan=scan)


CUTTER: Final = NumberedCutter(survey=JbiSurvey, add_moves=_add_moves, take=_take)
