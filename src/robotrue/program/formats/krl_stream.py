"""Long KRL programs in blocks: the outline of a ``.src`` with its motions inline, and its pieces.

A *stretch* is lines between two statements that may change frames, move the robot or branch: plain
motions, comments, and statements such as ``$VEL.CP=0.1`` that no target depends on. Where a stretch
begins the skeleton has one pose and one axis target; all other lines of it are empty there, so that
line numbers stay. Blocks begin with a target that leaves nothing out.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numba
import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_read import read_krl
from robotrue.program.formats.krl_scan import (
    AXIS,
    INLINE_ARC,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
    scan,
)
from robotrue.program.formats.krl_walk import Walk
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.program.stream import Block, Judged, Outline, Piece, Whole

WINDOW: Final = 1 << 23
"""Bytes scanned at a time."""
LEAD: Final = 256
"""Targets before a block that say where the arm comes from."""
MOST_STRETCHES: Final = 50_000
_LONGEST_BLOCK: Final = 4  # times the targets asked for
_POSE_LINE: Final = b"LIN {X 0,Y 0,Z 0,A 0,B 0,C 0}"
_AXIS_LINE: Final = b"PTP {A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}"
_IDLE: Final = re.compile(
    rb"\s*(?:\$(?:VEL|ACC|VEL_AXIS|ACC_AXIS|APO|ADVANCE|OV_PRO|OUT)(?:\s*\[\s*\d+\s*\])?"
    rb"(?:\.\w+)?\s*=\s*(?:[+-]?\d+(?:\.\d*)?|[+-]?\.\d+|TRUE|FALSE)|WAIT\s+SEC\s+[\d.]+|HALT)\s*",
    re.IGNORECASE,
)
"""Statements that neither move the robot nor touch frames, points or the way of the program."""

NOTHING, FULL, PARTIAL, ODD, MIXED = 0, 1, 2, 3, 4
"""What a line holds: no plain motion; one that leaves nothing out; one that leaves something out;
one that is computed; an arc with axis values."""


def outline(
    path: Path, companions: tuple[Path, ...], frames: FrameTable, targets: int
) -> Outline | Whole:
    """Returns the outline of a ``.src``, or why it must be read whole.

    Raises:
        FormatError: The file is not KRL, cut off, or has a number that cannot be read.
    """
    if path.suffix.lower() == ".dat":
        return Whole(why="points of a .dat are read whole")
    if frames.external:
        return Whole(why="external axes in the kinematic chain need every target at once")
    if frames.fixed_tool:
        return Whole(why="a part on the robot is read whole")
    survey = _Survey(path.name, targets)
    with path.open("rb") as stream:
        for data in _windows(stream):
            refused = survey.take(data)
            if refused is not None:
                return refused
    refused = survey.close()
    if refused is None and survey.external and not (frames.external_axes_at_rest and survey.still):
        refused = Whole(why="external axes are away from zero")
    return refused or _judged(survey, path, companions, frames)


def _windows(stream: BinaryIO) -> Iterator[bytes]:
    """Yields the bytes in windows of whole lines."""
    rest = b""
    while chunk := stream.read(WINDOW):
        data = rest + chunk
        cut = data.rfind(b"\n") + 1
        if cut:
            yield data[:cut]
        rest = data[cut:]
    if rest:
        yield rest


class _Survey:
    """One pass over the file."""

    def __init__(self, name: str, targets: int) -> None:
        self.name, self.asked = name, targets
        self.hash = hashlib.sha256()
        self.size = self.lines = self.targets = 0
        self.external, self.still = False, True
        self._values = np.full(6, np.nan)
        self._skeleton: list[bytes] = []
        self._written = 0
        self.stretch: list[int] = []
        self.shown: list[tuple[int, int]] = []  # (line, stretch) of the skeleton's targets
        self._event = self._full = -1  # line of the last statement, of the last full motion
        self._second = b""
        self._cuts: list[tuple[int, int, int]] = [(0, 0, 0)]  # byte, line, targets before
        self._leads: list[tuple[int, int]] = [(0, 0)]
        self._places = np.zeros((0, 3), np.int64)  # of the last full motions, likewise

    def take(self, data: bytes) -> Whole | None:
        """Adds a window; returns why the file must be read whole, if so."""
        self.hash.update(data)
        if len(data) > 8 * WINDOW:
            return Whole(why="a line is longer than any controller reads", line=self.lines + 1)
        if self.size + len(data) >= 2**40 or b"\0" in data or (not self.size and _odd_head(data)):
            return Whole(why="the encoding is to be judged", line=self.lines + 1)
        found = self._scanned(data)
        rows, kind, away, steady = _survey_lines(
            found.line_kind, found.agg_line, found.agg_flag, found.agg_token,
            found.tok_component, found.tok_value, self._values,
        )  # fmt: skip
        self.external |= bool(away)
        self.still &= bool(steady)
        refused = self._stretches(found, kind)
        self._cut(found, rows, kind)
        self.size += len(data)
        self.lines += len(found.line_kind)
        self.targets += int(rows.sum())
        since = self.targets - self._cuts[-1][2]
        if refused is None and since > _LONGEST_BLOCK * self.asked:
            return Whole(
                why=f"{since} targets after it without one that leaves nothing out",
                line=self._cuts[-1][1] + 1,
            )
        return refused

    def _scanned(self, data: bytes) -> Scan:
        try:
            return scan(data, name=self.name)
        except FormatError as cause:
            line = None if cause.line is None else cause.line + self.lines
            raise FormatError(cause.message, source=self.name, line=line, hint=cause.hint) from None

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

    def _represent(self, line: int, code: bytes) -> None:
        self.shown.append((self.lines + line, len(self.stretch) - 1))
        self._write(line, code)

    def _write(self, line: int, code: bytes) -> None:
        blank = self.lines + line - self._written
        self._skeleton.append(b"\n" * blank + code + b"\n")
        self._written += blank + 1

    def skeleton(self) -> bytes:
        """Returns the text the ordinary reader judges."""
        return b"".join(self._skeleton)

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

    def _cut(self, found: Scan, rows: IntArray, kind: IntArray) -> None:
        """Begins blocks where they are due."""
        may = np.flatnonzero((kind == FULL) & (found.line_kind != INLINE_ARC))
        before = self.targets + np.cumsum(rows) - rows
        places = np.column_stack(
            [found.line_start[may] + self.size, may + self.lines, before[may]]
        ).astype(np.int64)
        known = np.concatenate([self._places, places])
        while True:
            at = int(np.searchsorted(places[:, 2], self._cuts[-1][2] + self.asked))
            if at >= len(places):
                break
            byte, line, count = places[at].tolist()
            self._cuts.append((byte, line, count))
            lead = max(int(np.searchsorted(known[:, 2], count - LEAD, side="right")) - 1, 0)
            self._leads.append((int(known[lead, 0]), int(known[lead, 1])))
        self._places = known[-4 * LEAD :]

    def close(self) -> Whole | None:
        """Ends the pass."""
        if not self.targets:
            return Whole(why="no motions to targets given in place")
        return None

    def blocks(self) -> tuple[Block, ...]:
        """Returns the blocks of the file."""
        ends = [*self._cuts[1:], (self.size, self.lines, self.targets)]
        return tuple(
            Block(
                piece=self._piece(start, end, line, last),
                lead=self._piece(lead, start, lead_line, line),
                first=first,
                targets=after - first,
            )
            for (start, line, first), (end, last, after), (lead, lead_line) in zip(
                self._cuts, ends, self._leads, strict=True
            )
        )

    def _piece(self, start: int, end: int, line: int, last: int) -> Piece:
        begins = np.array(self.stretch, np.int64)
        first = max(int(np.searchsorted(begins, line, side="right")) - 1, 0)
        until = max(int(np.searchsorted(begins, last)), first + 1)
        return Piece(
            start=start,
            end=end,
            line=line,
            judged_from=begins[first:until],
            judgement=np.arange(first, min(until, len(begins))),
        )


def _odd_head(data: bytes) -> bool:
    return data.startswith((b"\xff\xfe", b"\xfe\xff"))


@numba.njit(cache=True)
def _survey_lines(
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


def _judged(
    survey: _Survey, path: Path, companions: tuple[Path, ...], frames: FrameTable
) -> Outline | Whole:
    """Returns the outline, with the ordinary reader's judgement of every stretch."""
    files = [(path.name, survey.skeleton())]
    files += [(other.name, read_bytes(other)) for other in companions]
    skeleton, *others = read_krl(files, frames)
    lines, stretches = np.array(survey.shown, np.int64).T
    extra = np.setdiff1d(skeleton.line - 1, lines)
    if len(extra) or len(skeleton) != len(lines):
        at = int(extra[0]) + 1 if len(extra) else 0
        return Whole(why="a target that is stored or has clauses of its own", line=at)
    if len(skeleton.held) and skeleton.held.any():
        return Whole(why="the robot carries the part")
    axis = np.asarray(skeleton.spans.is_axis)
    judged = np.zeros((len(survey.stretch), 4), np.int64)
    for column, values in ((0, skeleton.frame), (1, skeleton.tool)):
        judged[stretches, column] = values
    judged[stretches[~axis], 2] = skeleton.reason[~axis]
    judged[stretches[axis], 3] = skeleton.reason[axis]
    return Outline(
        name=path.name,
        dialect="krl",
        size=survey.size,
        sha256=survey.hash.hexdigest(),
        targets=survey.targets,
        judged=judged,
        T_base_frame=skeleton.T_base_frame,
        T_flange_tool=skeleton.T_flange_tool,
        external_axes_at_rest=frames.external_axes_at_rest,
        blocks=survey.blocks(),
        notes=tuple(re.sub(r"\b\d+ targets", "targets", note) for note in skeleton.notes),
        companions=tuple(program for program in others if len(program)),
    )


def read_piece(data: bytes, piece: Piece, judged: Judged) -> Program:
    """Returns the targets of a piece, as they stand in the program of the whole file.

    Statements are not read again: the outline says what they bring about.
    """
    given = FrameTable(external_axes_at_rest=judged.external_axes_at_rest)
    walk = Walk([scan(data, name=judged.name)], [judged.name], Frames(given, judged.name))
    found = Builder(walk, 0, given).program(0)
    line = found.line + piece.line
    axis: BoolArray = np.asarray(found.spans.is_axis)
    at = np.searchsorted(piece.judged_from, line - 1, side="right") - 1
    state = judged.table[piece.judgement[at]]
    own = (found.reason != Reason.NONE) & (found.reason != Reason.JOINT_TARGET)
    return replace(
        found,
        line=line,
        reason=np.where(own, found.reason, np.where(axis, state[:, 3], state[:, 2])),
        frame=state[:, 0],
        tool=state[:, 1],
        T_base_frame=judged.T_base_frame,
        T_flange_tool=judged.T_flange_tool,
        notes=(),
    )
