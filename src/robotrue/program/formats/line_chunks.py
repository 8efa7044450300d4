"""Long programs of languages with one motion in a line: RAPID modules and UR scripts.

A line is *plain* if it is one whole motion to targets in place; what it names next to them, such as
tool and work object, is its key. A stretch is plain lines with one key and no other statement
between. A chunk is read by the ordinary reader of the language, between a head and a foot that make
it a program, with all but its plain lines blank.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from robotrue.program.formats.file_survey import NO_KEY, Survey, WindowLines
from robotrue.program.formats.text_lines import line_edges
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable
from robotrue.program.program_chunk import ChunkLines, ReadChunk, Skeleton, Whole

Key: TypeAlias = tuple[bytes, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LineCutter:
    """Reads the long files of a language whose plain motions are lines.

    Attributes:
        plain: Matches one with its line end. The groups whose names begin with ``key`` are its key;
            the group ``via`` is there if it has two targets.
        idle: Matches lines without effect.
        around: From the keys of plain lines to the text before and after them that makes a program
            of them, and frames by name; any one is enough.
        moved_frames: External axes in the chain are in frames of the program, not in a target.
    """

    plain: re.Pattern[bytes]
    idle: re.Pattern[bytes]
    around: Callable[[set[Key]], tuple[bytes, bytes, FrameTable]]
    moved_frames: bool = False

    def key(self, match: re.Match[bytes]) -> Key:
        """Returns the key of a plain line."""
        groups = match.groupdict(b"")
        return tuple(groups[name] for name in groups if name.startswith("key"))

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a file of this name, not yet run, or why it cannot be cut."""
        if frames.external and self.moved_frames:
            return Whole(why="external axes in the kinematic chain need every target at once")
        return LineSurvey(name, targets, self)

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines; their data are between a head and a foot."""
        keys: set[Key] = set()
        text = np.frombuffer(data, np.uint8).copy()
        for start, end in pairwise(line_edges(data).tolist()):
            plain = self.plain.fullmatch(data, start, end)
            if plain:
                keys.add(self.key(plain))
            else:
                line = text[start:end]
                line[(line != 10) & (line != 13)] = 32
        head, foot, frames = self.around(keys)
        program = find_language(skeleton.program.dialect).read(
            head + text.tobytes() + foot, name=skeleton.program.name, frames=frames
        )
        line_of = program.line - head.count(b"\n")
        program = replace(program, data=head + data + foot, line=line_of)
        return ReadChunk(program, len(head), len(foot))


class LineSurvey(Survey):
    """One pass over a file."""

    events = "lines that are no plain motions"

    def __init__(self, name: str, targets: int, cutter: LineCutter) -> None:
        super().__init__(name, targets)
        self._cutter = cutter
        self._numbers: dict[Key, int] = {}

    def _sort_lines(self, data: bytes) -> WindowLines:
        cutter, edges = self._cutter, line_edges(data)
        targets, key = np.zeros(len(edges) - 1, np.int64), np.full(len(edges) - 1, NO_KEY)
        event = np.zeros(len(targets), np.bool_)
        for line, (start, end) in enumerate(pairwise(edges.tolist())):
            plain = cutter.plain.fullmatch(data, start, end)
            if plain:
                targets[line] = 2 if plain["via"] is not None else 1
                key[line] = self._numbers.setdefault(cutter.key(plain), len(self._numbers))
            else:
                event[line] = not cutter.idle.fullmatch(data, start, end)
        return WindowLines(
            data=data, start=edges[:-1], end=edges[1:], targets=targets, opens=targets > 0,
            partial=np.zeros_like(event), event=event, key=key,
        )  # fmt: skip


def _list_items(item: bytes, count: int) -> bytes:
    """Returns a pattern of so many items with commas between."""
    return rb"\s*,\s*".join([item] * count)


_NUMBER: Final = rb"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"
_ABSENT: Final = rb"(?:9[eE]\+?0?9|0(?:\.0*)?)"
_ROBTARGET: Final = (
    rb"\[\s*\[" + _list_items(_NUMBER, 3) + rb"\]\s*,\s*\[" + _list_items(_NUMBER, 4)
    + rb"\]\s*,\s*\[" + _list_items(rb"-?\d+", 4) + rb"\]\s*,\s*\["
    + _list_items(_ABSENT, 6) + rb"\]\s*\]"
)  # fmt: skip
_JOINTTARGET: Final = (
    rb"\[\s*\[" + _list_items(_NUMBER, 6) + rb"\]\s*,\s*\[" + _list_items(_ABSENT, 6) + rb"\]\s*\]"
)
_RAPID_VALUE: Final = rb"(?:\w+|\[[\d.,eE+\-\s]*\])"


def _put_in_module(keys: set[Key]) -> tuple[bytes, bytes, FrameTable]:
    tools, works = ({key[k].decode("ascii") for key in keys} for k in (1, 2))
    frames = FrameTable(
        tools={name: np.eye(4) for name in tools if name.lower() != "tool0"},
        bases={name: np.eye(4) for name in works if name.lower() not in ("", "wobj0")},
    )
    return b"MODULE m\nPROC p()\n", b"\nENDPROC\nENDMODULE\n", frames


RAPID: Final = LineCutter(
    moved_frames=True,
    plain=re.compile(
        rb"[ \t]*Move(?:(?:L|J|(?P<via>C))[ \t]+"
        + _ROBTARGET + rb"(?(via)\s*,\s*" + _ROBTARGET + rb")"
        rb"|(?P<key_axes>AbsJ)[ \t]+" + _JOINTTARGET + rb"(?:\\NoEOffs)?)"
        rb"\s*,\s*" + _RAPID_VALUE + rb"(?:\\[VT]:=[\d.]+)?\s*,\s*" + _RAPID_VALUE
        + rb"\s*,\s*(?P<key_tool>\w+)"
        rb"\s*,?\s*(?:\\WObj\s*:=\s*(?P<key_work>\w+)\s*)?;[ \t]*(?:![^\r\n]*)?[\r\n]*",
        re.IGNORECASE,
    ),
    idle=re.compile(rb"[ \t]*(?:![^\r\n]*)?[\r\n]*"),
    around=_put_in_module,
)  # fmt: skip


_SIX: Final = rb"\[\s*" + _list_items(_NUMBER, 6) + rb"\s*\]"


def _put_in_routine(keys: set[Key]) -> tuple[bytes, bytes, FrameTable]:
    named = sorted({frame for frame, _ in keys if frame})
    frames = b"".join(b"  %b = p[0,0,0,0,0,0]\n" % name for name in named)
    return b"def p():\n" + frames, b"\nend\n", FrameTable()


URSCRIPT: Final = LineCutter(
    plain=re.compile(
        rb"[ \t]*move(?:[lpj]\(\s*(?:p" + _SIX
        + rb"|pose_trans\(\s*(?P<key_frame>[A-Za-z_]\w*)\s*,\s*p" + _SIX + rb"\s*\))"
        + rb"|(?P<via>c)\(\s*p" + _SIX + rb"\s*,\s*p" + _SIX
        + rb"|(?P<key_axes>j)\(\s*" + _SIX
        + rb")\s*(?:,[\w\s=.,+\-]*)?\)[ \t]*(?:#[^\r\n]*)?[\r\n]*"
    ),
    idle=re.compile(rb"[ \t]*(?:#[^\r\n]*)?[\r\n]*"),
    around=_put_in_routine,
)  # fmt: skip
