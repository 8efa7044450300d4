"""The survey of a KRL program with its motions inline.

A stretch is what stands between two statements that may change frames, move the robot or branch. In
the skeleton one pose and one axis target stand for it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numba
import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.core.compiled import cached
from robotrue.program.formats.krl_scan import (
    AXIS,
    INLINE_ARC,
    INLINE_LIN,
    INLINE_PTP,
    INLINE_SPLINE,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
)
from robotrue.program.formats.krl_survey import (
    FULL,
    MIXED,
    NOTHING,
    ODD,
    PARTIAL,
    KrlSurvey,
)
from robotrue.program.formats.long_survey import MOST_STRETCHES
from robotrue.program.program import Program
from robotrue.program.stream import Whole

_POSE_LINE: Final = b"LIN {X 0,Y 0,Z 0,A 0,B 0,C 0}"
_AXIS_LINE: Final = b"PTP {A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}"
_IDLE: Final = re.compile(
    rb"\s*(?:\$(?:VEL|ACC|VEL_AXIS|ACC_AXIS|APO|ADVANCE|OV_PRO|OUT)(?:\s*\[\s*\d+\s*\])?"
    rb"(?:\.\w+)?\s*=\s*(?:[+-]?\d+(?:\.\d*)?|[+-]?\.\d+|TRUE|FALSE)|WAIT\s+SEC\s+[\d.]+|HALT)\s*",
    re.IGNORECASE,
)
"""Statements that neither move the robot nor touch frames, points or the way of the program."""


_SETTING: Final = (
    rb"\$(?:VEL|ACC|APO|ORI_TYPE|CIRC_TYPE|GEAR_JERK|JERK)(?:_\w+)?(?:\s*\[\s*\d+\s*\])?(?:\.\w+)?"
    rb"\s*=\s*(?:[+-]?\d+(?:\.\d*)?|[+-]?\.\d+|#\w+)\s*"
)
_CLAUSED: Final = re.compile(
    rb"\s*S?(?P<how>PTP|LIN|SPL|CIRC)\s*\{[^{}]*\}\s*(?P<end>,\s*\{[^{}]*\}\s*(?:,\s*CA\s*[-+\d.]+\s*)?)?"
    rb"(?:C_\w+\s*)*(?:WITH\s+" + _SETTING + rb"(?:,\s*" + _SETTING + rb")*)?",
    re.IGNORECASE,
)
"""A motion that the scanner leaves to the reader for clauses that change no frame."""
_HOW: Final = {b"PTP": INLINE_PTP, b"LIN": INLINE_LIN, b"SPL": INLINE_SPLINE, b"CIRC": INLINE_ARC}


def with_clauses(found: Scan) -> Scan:
    """Returns the scan with motions that have an angle or speeds of their own as plain ones."""
    told = found.line_kind[found.agg_line] == STATEMENT
    lines, count = np.unique(found.agg_line[told], return_counts=True)
    if not len(lines):
        return found
    kind = np.array(found.line_kind)
    for line, aggregates in zip(lines.tolist(), count.tolist(), strict=True):
        code = _CLAUSED.fullmatch(
            found.data, int(found.line_start[line]), int(found.line_end[line])
        )
        arc = code is not None and code["how"].upper() == b"CIRC"
        if code and aggregates == 1 + arc and arc == (code["end"] is not None):
            kind[line] = _HOW[code["how"].upper()]
    return replace(found, line_kind=kind)


class MotionSurvey(KrlSurvey):
    """One pass over a ``.src``."""

    def __init__(self, name: str, targets: int) -> None:
        super().__init__(name, targets)
        self._event = self._full = -1  # line of the last statement, of the last full motion
        self._second = b""

    def _scanned(self, data: bytes) -> Scan:
        return with_clauses(super()._scanned(data))

    def _sorted(self, found: Scan) -> tuple[IntArray, IntArray, bool, bool]:
        rows, kind, away, still = _motions(
            found.line_kind, found.agg_line, found.agg_flag, found.agg_token,
            found.tok_component, found.tok_value, self._first_external,
        )  # fmt: skip
        return rows, kind, bool(away), bool(still)

    def _stretches(self, found: Scan, kind: IntArray) -> Whole | None:
        """Adds the lines to the skeleton; refuses what depends on lines before a statement."""
        statements = np.flatnonzero(found.line_kind == STATEMENT)
        events = [
            k
            for k in statements.tolist()
            if not _IDLE.fullmatch(found.data, int(found.line_start[k]), int(found.line_end[k]))
        ]
        if len(self.stretch) + len(events) > MOST_STRETCHES:
            return Whole(
                why=f"more than {MOST_STRETCHES} statements that may change frames or branch",
                line=self.lines + 1,
            )
        mixed = np.flatnonzero(kind == MIXED)
        if len(mixed):
            return Whole(why="an arc through axis values", line=self.lines + int(mixed[0]) + 1)
        refused = self._inherited(np.array([self._event, *(self.lines + k for k in events)]), kind)
        moves = np.flatnonzero(kind != NOTHING)
        edges = [*events, len(kind)]
        self._show(moves, kind, found, -1, edges[0])
        for event, following in zip(events, edges[1:], strict=True):
            code = found.data[found.line_start[event] : found.line_end[event]]
            self._write(event, code)
            self._second = b""
            self._event = self.lines + event
            self._show(moves, kind, found, event, following)
        return refused

    def _show(self, moves: IntArray, kind: IntArray, found: Scan, after: int, before: int) -> None:
        """Represents the motions between two lines of a window, if they begin a stretch."""
        if self._second and after < 0 and before > 0:
            self._represent(0, self._second)
            self._second = b""
        if self.stretch and self.stretch[-1] > self._event:
            return
        at = int(np.searchsorted(moves, after, side="right"))
        if at >= len(moves) or moves[at] >= before:
            return
        line = int(moves[at])
        agg = int(np.searchsorted(found.agg_line, line))
        token = int(found.agg_token[agg])
        axis = token < int(found.agg_token[agg + 1]) and found.tok_component[token] >= AXIS
        self.stretch.append(self.lines + line)
        one, other = (_AXIS_LINE, _POSE_LINE) if axis else (_POSE_LINE, _AXIS_LINE)
        self._represent(line, one)
        if line + 1 < before:
            self._represent(line + 1, other)
        elif before == len(kind):
            self._second = other

    def _inherited(self, events: IntArray, kind: IntArray) -> Whole | None:
        """Refuses a target that inherits components from before the last of the statements."""
        partial, full = (np.flatnonzero(kind == what) + self.lines for what in (PARTIAL, FULL))
        given = np.concatenate([[self._full], full])
        self._full = int(given[-1])
        giver = given[np.searchsorted(given, partial) - 1]
        lost = giver <= events[np.searchsorted(events, partial) - 1]
        if not lost.any():
            return None
        return Whole(
            why="a target leaves components out that no motion just before it gives",
            line=int(partial[np.argmax(lost)]) + 1,
        )

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the judgement of every stretch (s, 5), or why there is none."""
        refused = self.require_shown(skeleton.line - 1)
        if refused is not None:
            return refused
        if len(skeleton.held) and skeleton.held.any():
            return Whole(why="the robot carries the part")
        stretch = np.array([number for _, number in self.shown], np.int64)
        axis = np.asarray(skeleton.spans.is_axis)
        judged = np.zeros((len(self.stretch), 5), np.int64)
        judged[stretch, 0], judged[stretch, 1] = skeleton.frame, skeleton.tool
        judged[stretch[~axis], 2] = skeleton.reason[~axis]
        judged[stretch[axis], 3] = skeleton.reason[axis]
        judged[:, 4] = -1
        return judged


@cached
@numba.njit
def _motions(
    line_kind: Any,
    agg_line: Any,
    agg_flag: Any,
    agg_token: Any,
    component: Any,
    value: Any,
    first: Any,
) -> Any:
    """Returns targets and kind of every line, whether external axes are away, and stand still.

    ``first`` (6,) are the external values of the first target of the file, infinite where it has
    none; NaN before it, and written then.
    """
    rows, kind = np.zeros(line_kind.size, np.int64), np.zeros(line_kind.size, np.int64)
    here = np.empty(6)
    away, steady = False, True
    for agg in range(agg_line.size):
        line = agg_line[agg]
        if line_kind[line] <= STATEMENT:
            continue
        rows[line] += 1
        pose, axis = 0, 0
        here[:] = np.inf
        for t in range(agg_token[agg], agg_token[agg + 1]):
            code = component[t]
            if code < 6:
                pose += 1
            elif code < 12:
                axis += 1
            elif code < 18:
                here[code - 12] = value[t]
                away |= value[t] != 0.0
        for k in range(6):
            if np.isnan(first[k]):
                first[k] = here[k]
            steady &= first[k] == here[k]
        what = PARTIAL
        if agg_flag[agg] & NOT_CONSTANT or (pose > 0 and axis > 0) or pose + axis == 0:
            what = ODD
        elif pose + axis == 6:
            what = FULL
        if line_kind[line] == INLINE_ARC and axis > 0:
            what = MIXED
        kind[line] = max(kind[line], what)
    return rows, kind, away, steady
