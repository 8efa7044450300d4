"""Long KRL files: the survey of a program with its motions inline, and the chunks of any file.

A stretch is what stands between two statements that may change frames, move the robot or branch. In
the skeleton one pose and one axis target stand for it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.formats.file_survey import Survey, WindowLines
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_columns import count_parts
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_scan import (
    INLINE_ARC,
    INLINE_LIN,
    INLINE_PTP,
    INLINE_SPLINE,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
    scan,
)
from robotrue.program.formats.krl_surveys import KrlSurvey, PointSurvey, as_motions, line_edges
from robotrue.program.formats.krl_walk import KrlWalk
from robotrue.program.program import FrameTable
from robotrue.program.program_chunk import ChunkRules, ReadChunk, Whole

NOTHING, FULL, PARTIAL, ODD, MIXED = 0, 1, 2, 3, 4
"""What a line holds: no plain motion; one that leaves nothing out; one that leaves something out;
one that is computed; an arc with axis values."""
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
    stated = found.line_kind[found.agg_line] == STATEMENT
    lines, count = np.unique(found.agg_line[stated], return_counts=True)
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

    events = "statements that may change frames or branch"

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets, axes_at_rest=axes_at_rest)
        self._event = self._full = -1  # line of the last statement, of the last full motion
        self._open = False
        self._axis_first: BoolArray = np.zeros(0, np.bool_)
        self._second = b""

    def _sort_scan(self, found: Scan) -> WindowLines | Whole:
        found = with_clauses(found)
        targets, kind, self._axis_first = _motions(found)
        moves = kind != NOTHING
        self._external.add(found, moves)
        if (kind == MIXED).any():
            mixed = int(np.argmax(kind == MIXED))
            return Whole(why="an arc through axis values", line=self.lines + mixed + 1)
        event = np.zeros(len(kind), np.bool_)
        for line in np.flatnonzero(found.line_kind == STATEMENT).tolist():
            start, end = int(found.line_start[line]), int(found.line_end[line])
            event[line] = not _IDLE.fullmatch(found.data, start, end)
        refused = self._check_inherited(np.flatnonzero(event), kind)
        if refused is not None:
            return refused
        after = np.cumsum(event)
        some, first = np.unique(after[moves], return_index=True)
        first = np.flatnonzero(moves)[first[some > 0] if self._open else first]
        begins = np.zeros(len(kind), np.bool_)
        begins[first] = True
        self._open = bool(moves[after == after[-1]].any()) or (self._open and not after[-1])
        opens = np.asarray((kind == FULL) & (found.line_kind != INLINE_ARC))
        return WindowLines(found.data, *line_edges(found), targets, opens, event, begins)

    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        both = [_POSE_LINE, _AXIS_LINE]
        one, self._second = both[::-1] if self._axis_first[line] else both
        self._represent(line, one)

    def _continue_stretch(self, lines: WindowLines, since: int, until: int) -> None:
        if self._second and until > since:
            self._represent(since, self._second)
            self._second = b""

    def _end_stretch(self) -> None:
        self._second = b""

    def _check_inherited(self, events: IntArray, kind: IntArray) -> Whole | None:
        """Refuses a target that inherits components from before the last of the statements."""
        events = np.concatenate([[self._event], events + self.lines])
        partial, full = (np.flatnonzero(kind == what) + self.lines for what in (PARTIAL, FULL))
        given = np.concatenate([[self._full], full])
        self._event, self._full = int(events[-1]), int(given[-1])
        giver = given[np.searchsorted(given, partial) - 1]
        lost = giver <= events[np.searchsorted(events, partial) - 1]
        if not lost.any():
            return None
        return Whole(
            why="a target leaves components out that no motion just before it gives",
            line=int(partial[np.argmax(lost)]) + 1,
        )


def _motions(found: Scan) -> tuple[IntArray, IntArray, BoolArray]:
    """Returns targets and kind of every line, and whether its first target has axis values."""
    pose, axis = count_parts(found)
    what = np.where(pose + axis == 6, FULL, PARTIAL)
    odd = (pose > 0) & (axis > 0) | (pose + axis == 0) | (found.agg_flag & NOT_CONSTANT > 0)
    what[odd] = ODD
    of_line = found.line_kind[found.agg_line]
    what[(of_line == INLINE_ARC) & (axis > 0)] = MIXED
    plain = np.flatnonzero(of_line > STATEMENT)
    lines, count = found.agg_line[plain], len(found.line_kind)
    kind, axis_first = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    np.maximum.at(kind, lines, what[plain])
    some, first = np.unique(lines, return_index=True)
    axis_first[some] = axis[plain[first]] > 0
    return np.bincount(lines, minlength=count), kind, axis_first


class KrlCutter:
    """Reads long ``.src`` and ``.dat`` files."""

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a ``.src`` or ``.dat``, not yet run, or why it cannot be cut."""
        if frames.external:
            return Whole(why="external axes in the kinematic chain need every target at once")
        if frames.fixed_tool:
            return Whole(why="a part on the robot is read whole")
        of_file = PointSurvey if name.lower().endswith(".dat") else MotionSurvey
        return of_file(name, targets, axes_at_rest=frames.external_axes_at_rest)

    def read_lines(self, data: bytes, rules: ChunkRules) -> ReadChunk:
        """Returns the targets of some lines of a ``.src`` or ``.dat``."""
        frames = FrameTable(external_axes_at_rest=rules.external_axes_at_rest)
        lines = scan(data, name=rules.name)
        lines = as_motions(lines) if rules.name.lower().endswith(".dat") else with_clauses(lines)
        walk = KrlWalk([lines], [rules.name], Frames(frames, rules.name))
        return ReadChunk(Builder(walk, 0, frames).program(0))


CUTTER: Final = KrlCutter()
