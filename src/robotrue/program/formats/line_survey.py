"""Long programs of languages with one motion in a line: their survey, and their pieces.

A line is *plain* if it is one whole motion to targets in place; what it names beside them, such as
tool and work object, is its key. A stretch is plain lines with one key and no other statement
between; its first line stands for it in the skeleton. A piece is read by the ordinary reader of the
language, between a head and a foot that make it a program, with all but its plain lines blank.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.formats.long_survey import MOST_STRETCHES, Lines, Survey
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.program import Dialect, FrameTable, Program, Reason, Replacement
from robotrue.program.stream import Judged, Piece, Whole


@dataclass(frozen=True, slots=True, kw_only=True)
class LineForm:
    """What plain lines of a language look like.

    Attributes:
        plain: Matches one with its line end. The groups whose names begin with ``key`` are its key;
            the group ``via`` is there if it has two targets.
        idle: Matches lines without effect.
        mark: Last line of what stands before such lines to make a program of them.
        foot: What stands behind them.
    """

    plain: re.Pattern[bytes]
    idle: re.Pattern[bytes]
    mark: bytes
    foot: bytes

    def key(self, match: re.Match[bytes]) -> tuple[bytes, ...]:
        """Returns the key of a plain line."""
        found = match.groupdict(b"")
        return tuple(found[name] for name in found if name.startswith("key"))


class LineSurvey(Survey):
    """One pass over a file."""

    def __init__(self, name: str, targets: int, form: LineForm) -> None:
        super().__init__(name, targets)
        self._form = form
        self._key: tuple[bytes, ...] | None = None
        self._events = 0

    def _window(self, data: bytes) -> tuple[Lines, Whole | None]:
        starts = line_starts(data)
        starts = starts[starts < len(data)]
        targets = np.zeros(len(starts), np.int64)
        form = self._form
        edges = [*starts.tolist(), len(data)]
        for line, (start, end) in enumerate(pairwise(edges)):
            plain = form.plain.fullmatch(data, start, end)
            if plain:
                targets[line] = 2 if plain["via"] is not None else 1
                key = form.key(plain)
                if key != self._key:
                    self._begin(line, data[start:end].rstrip(b"\r\n"), int(targets[line]))
                    self._key = key
            elif not form.idle.fullmatch(data, start, end):
                self._write(line, data[start:end].rstrip(b"\r\n"))
                self._key = None
                self._events += 1
        found = Lines(starts, targets, np.asarray(targets > 0))
        if len(self.stretch) + self._events <= MOST_STRETCHES:
            return found, None
        return found, Whole(
            why=f"more than {MOST_STRETCHES} lines that are no plain motions", line=self.lines + 1
        )

    def _begin(self, line: int, code: bytes, targets: int) -> None:
        self.stretch.append(self.lines + line)
        self._represent(line, code)
        self.shown += [self.shown[-1]] * (targets - 1)

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the judgement of every stretch (s, 5), or why there is none."""
        refused = self.require_shown(skeleton.line - 1)
        if refused is not None:
            return refused
        if len(skeleton.held) and skeleton.held.any():
            return Whole(why="the robot carries the part")
        stretch = np.array([number for _, number in self.shown], np.int64)
        judged = np.full((len(self.stretch), 5), -1)
        reason = skeleton.reason
        judged[stretch, :4] = np.column_stack([skeleton.frame, skeleton.tool, reason, reason])
        return judged


def read_lines(
    data: bytes,
    piece: Piece,
    judged: Judged,
    form: LineForm,
    language: Dialect,
    head: bytes,
    given: FrameTable,
) -> Program:
    """Returns the targets of a piece; its data stand between head and foot.

    Args:
        data: The bytes of the piece.
        piece: Its place.
        judged: What the outline says.
        form: Of the language.
        language: Its reader.
        head: What makes a program of plain lines; ends with the mark.
        given: Frames under all the names that plain lines of the piece have; any will do.
    """
    text = np.frombuffer(data, np.uint8).copy()
    starts = line_starts(data)
    edges = [*starts[starts < len(data)].tolist(), len(data)]
    for start, end in pairwise(edges):
        if not form.plain.fullmatch(data, start, end):
            line = text[start:end]
            line[(line != 10) & (line != 13)] = 32
    found = language.read(head + text.tobytes() + form.foot, name=judged.name, frames=given)
    line_of = found.line - head.count(b"\n") + piece.line
    at = np.searchsorted(piece.judged_from, line_of - 1, side="right") - 1
    state = judged.table[piece.judgement[at]]
    own: BoolArray = np.asarray(
        (found.reason != Reason.NONE) & (found.reason != Reason.JOINT_TARGET)
    )
    return replace(
        found,
        data=head + data + form.foot,
        line=line_of,
        reason=np.where(own, found.reason, state[:, 2]),
        frame=state[:, 0],
        tool=state[:, 1],
        T_base_frame=judged.T_base_frame,
        T_flange_tool=judged.T_flange_tool,
        notes=(),
    )


def written_lines(
    program: Program, replacement: Replacement, form: LineForm, language: Dialect
) -> bytes:
    """Returns the bytes of a piece with the changed numbers replaced, without head and foot."""
    out = language.write(program, replacement)
    return out[out.index(form.mark) + len(form.mark) : len(out) - len(form.foot)]


NUMBER = rb"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"


def listed(item: bytes, count: int) -> bytes:
    """Returns a pattern of so many items with commas between."""
    return rb"\s*,\s*".join([item] * count)
