"""Long programs of languages with one motion in a line: their survey, and their chunks.

A line is *plain* if it is one whole motion to targets in place; what it names beside them, such as
tool and work object, is its key. A stretch is plain lines with one key and no other statement
between; its first line stands for it in the skeleton. A chunk is read by the ordinary reader of the
language, between a head and a foot that make it a program, with all but its plain lines blank.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.file_survey import Survey, WindowLines
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable
from robotrue.program.program_chunk import ChunkRules, ReadChunk, Whole

Keys: TypeAlias = set[tuple[bytes, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class LineForm:
    """What plain lines of a language look like.

    Attributes:
        plain: Matches one with its line end. The groups whose names begin with ``key`` are its key;
            the group ``via`` is there if it has two targets.
        idle: Matches lines without effect.
        around: From the keys of plain lines to what stands before and behind them to make a program
            of them, and frames under the names they have; any will do.
    """

    plain: re.Pattern[bytes]
    idle: re.Pattern[bytes]
    around: Callable[[Keys], tuple[bytes, bytes, FrameTable]]

    def key(self, match: re.Match[bytes]) -> tuple[bytes, ...]:
        """Returns the key of a plain line."""
        groups = match.groupdict(b"")
        return tuple(groups[name] for name in groups if name.startswith("key"))


class LineSurvey(Survey):
    """One pass over a file."""

    events = "lines that are no plain motions"

    def __init__(self, name: str, targets: int, form: LineForm) -> None:
        super().__init__(name, targets)
        self._form = form
        self._key: tuple[bytes, ...] | None = None

    def _sort_lines(self, data: bytes) -> WindowLines:
        form, edges = self._form, _line_edges(data)
        targets = np.zeros(len(edges) - 1, np.int64)
        event, begins = np.zeros((2, len(targets)), np.bool_)
        for line, (start, end) in enumerate(pairwise(edges.tolist())):
            plain = form.plain.fullmatch(data, start, end)
            if plain:
                targets[line] = 2 if plain["via"] is not None else 1
                key = form.key(plain)
                begins[line] = key != self._key
                self._key = key
            elif not form.idle.fullmatch(data, start, end):
                event[line] = True
                self._key = None
        return WindowLines(data, edges[:-1], edges[1:], targets, targets > 0, event, begins)

    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        self._represent(line, lines.code(line), int(lines.targets[line]))


def _line_edges(data: bytes) -> IntArray:
    """Returns the first byte of every line, and the byte after the last (l + 1,)."""
    starts = line_starts(data)
    return np.append(starts[starts < len(data)], len(data))


@dataclass(frozen=True, slots=True, kw_only=True)
class LineCutter:
    """Reads the long files of a language whose plain motions are lines.

    Attributes:
        form: Of those lines.
        moved_frames: External axes in the chain are in frames of the program, not in a target.
    """

    form: LineForm
    moved_frames: bool = False

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> LineSurvey | Whole:
        """Returns the survey of a file of this name, not yet run, or why it cannot be cut."""
        if frames.external and self.moved_frames:
            return Whole(why="external axes in the kinematic chain need every target at once")
        return LineSurvey(name, targets, self.form)

    def read_lines(self, data: bytes, rules: ChunkRules) -> ReadChunk:
        """Returns the targets of some lines; their data stand between a head and a foot."""
        form, keys = self.form, Keys()
        text = np.frombuffer(data, np.uint8).copy()
        for start, end in pairwise(_line_edges(data).tolist()):
            plain = form.plain.fullmatch(data, start, end)
            if plain:
                keys.add(form.key(plain))
            else:
                line = text[start:end]
                line[(line != 10) & (line != 13)] = 32
        head, foot, frames = form.around(keys)
        program = find_language(rules.dialect).read(
            head + text.tobytes() + foot, name=rules.name, frames=frames
        )
        line_of = program.line - head.count(b"\n")
        program = replace(program, data=head + data + foot, line=line_of)
        return ReadChunk(program, len(head), len(foot))


NUMBER: Final = rb"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"


def list_items(item: bytes, count: int) -> bytes:
    """Returns a pattern of so many items with commas between."""
    return rb"\s*,\s*".join([item] * count)
