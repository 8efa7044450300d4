"""Long VAL3 applications: points of a ``.dtx``, and motions of the ``.pgx`` next to it.

A line is *plain* if it is one ``<Value .../>`` with the number of its element and six numbers, or
one motion to an element chosen by its number. Runs of plain motions to elements in turn, and what
other statements name, divide an array into parts: the code does the same with all elements of a
part. A stretch is points of one part with one reference frame. The skeleton has its first and last
point and, of the plain motions, those to them.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.file_survey import (
    LEAD,
    MOST_STRETCHES,
    NO_KEY,
    Survey,
    WindowLines,
)
from robotrue.program.formats.target_tokens import values_of
from robotrue.program.formats.text_lines import line_edges
from robotrue.program.formats.val3_files import PointValues
from robotrue.program.formats.val3_motions import MoveRun, find_runs
from robotrue.program.formats.val3_numbers import (
    AXIS_NAMES,
    POSE_NAMES,
    find_plain_points,
    find_point_numbers,
)
from robotrue.program.program import FrameTable, Motion, Program, Reason
from robotrue.program.program_chunk import ChunkLines, ReadChunk, Skeleton, Whole

_REST: Final = re.compile(rb"(?:[ \t]++\w++=(?:\"[\w\[\] .:\-]*+\"|'[\w\[\] .:\-]*+'))*+[ \t]*+")
_ATTRIBUTE: Final = re.compile(rb"(\w++)=.([^\"']*+)")
_NUMBERED: Final = frozenset(name.encode() for name in ("key", *POSE_NAMES, *AXIS_NAMES))
_TAG: Final = re.compile(rb"<(?:(/?)Data\b([^<>]*+)>|!\[CDATA\[)")
_NAME: Final = re.compile(rb"(?<![\w:])name\s*+=\s*+[\"'](\w++)[\"']")
_KIND: Final = re.compile(rb"(?<![\w:])type\s*+=\s*+[\"'](pointRx|jointRx)[\"']")
_COMMENT: Final = re.compile(rb"^[ \t]*+<!--(?:(?!--)[^\r\n])*+-->[ \t]*+\r?$|(<!--)", re.MULTILINE)
_ELEMENT: Final = re.compile(rb"([A-Za-z_]\w*+)\s*+\[\s*+0*+(\d{0,9}+)\s*+\]")


class _Points:
    """Finds plain points in the windows of a text, one after the other.

    Attributes:
        inside: Name of the array that is open, and whether it is of axis values.
        groups: Array and frame, as written, of points.
    """

    def __init__(self, inside: tuple[bytes, bool] | None = None) -> None:
        self.inside = inside
        self.groups: list[tuple[bytes, bytes]] = []
        self._numbers: dict[tuple[bytes, bytes], int] = {}
        self._fathers: dict[bytes, bytes | None] = {}

    def find(self, data: bytes, edges: IntArray) -> IntArray:
        """Returns line, first byte, element, whether of axes, and group (n, 5) of plain points."""
        found = find_plain_points(data, edges)
        group = np.full(len(found), -1)
        tags = [*_TAG.finditer(data)]
        places = np.searchsorted(found[:, 1], [tag.start() for tag in tags]).tolist()
        for tag, (start, end) in zip(
            (None, *tags), pairwise((0, *places, len(found))), strict=True
        ):
            if tag is not None:
                self._open(tag)
            if self.inside is not None:
                name, is_axis = self.inside
                of_kind = found[start:end, 3] == is_axis
                fathers = self._number_fathers(data, name, found[start:end])
                group[start:end] = np.where(of_kind, fathers, -1)
        return np.column_stack([found[:, :4], group])[group >= 0]

    def _number_fathers(self, data: bytes, name: bytes, found: IntArray) -> IntArray:
        """Returns the group of points of one array."""
        begins = found[:, 6] == 0
        begins[:1] = True
        numbers = []
        for start, end in found[begins, 4:6].tolist():
            rest = data[start:end]
            if rest not in self._fathers:
                self._fathers[rest] = _find_father(rest)
            father, number = self._fathers[rest], -1
            if father is not None:
                number = self._numbers.setdefault((name, father), len(self.groups))
                self.groups += [(name, father)] * (number == len(self.groups))
            numbers.append(number)
        return np.asarray(np.array(numbers, np.int64)[np.cumsum(begins) - 1])

    def _open(self, tag: re.Match[bytes]) -> None:
        text = tag[2] or b"/"
        name, kind = _NAME.search(text), _KIND.search(text)
        self.inside = None
        if not tag[1] and text[-1:] != b"/" and name and kind:
            self.inside = name[1], kind[1] == b"jointRx"


def _find_father(rest: bytes) -> bytes | None:
    """Returns the frame that attributes name, empty without one; None of odd attributes."""
    found: list[tuple[bytes, bytes]] = _ATTRIBUTE.findall(rest)
    known = dict(found)
    if not _REST.fullmatch(rest) or len(known) < len(found) or not _NUMBERED.isdisjoint(known):
        return None
    return known.get(b"fatherId", b"")


@dataclass(slots=True)
class _Application:
    """What the surveys of the files of an application share.

    Attributes:
        borders: First elements of the parts of every array.
        ends: First and last elements of stretches, by array; those shown.
        computed: A file without points moves to computed ones.
    """

    borders: dict[bytes, set[int]] = field(default_factory=lambda: defaultdict(lambda: {0, 1}))
    ends: dict[bytes, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))
    computed: bool = False


class Val3Survey(Survey):
    """Two passes over every file: for its motions, and for its points."""

    events = "lines that are neither elements of arrays nor motions to them in turn"
    stored = True

    def __init__(self, name: str, targets: int, shared: _Application | None = None) -> None:
        super().__init__(name, targets)
        self._shared = shared or _Application()
        self._others: list[Val3Survey] = []
        self._runs: list[MoveRun] = []
        self._points, self._number = _Points(), 0
        self._last_point = np.full((1, 3), -1)  # group, part and element
        self._kept: list[tuple[int, bytes]] = []
        self._opens = True  # a chunk may begin with the window, although there is no point

    @property
    def parts(self) -> Mapping[str, Survey]:
        """The surveys of all files, those with points last: the motions of all others matter."""
        ordered = sorted((*self._others, self), key=lambda each: each.targets > 0)
        return {each.name: each for each in ordered}

    def run(self, path: Path, beside: Sequence[Path] = ()) -> Whole | None:
        """Goes through the files of an application; returns why this one cannot be cut, if so."""
        self._others = [Val3Survey(each.name, self._asked, self._shared) for each in beside]
        job = [*zip(self._others, beside, strict=True), (self, path)]
        for survey, place in job:
            refused = survey._take_motions(place)
            if refused is not None:
                return refused
        for survey, place in job:
            refused = super(Val3Survey, survey).run(place)
            if refused is not None:
                return refused
            survey._note_ends()
        return None if self.targets else Whole(why="no points in arrays")

    def _check_end(self) -> Whole | None:
        return None

    def _take_motions(self, path: Path) -> Whole | None:
        """Finds the plain motions of a file, and the elements that other statements name."""
        line, borders = 0, self._shared.borders

        def take(data: bytes) -> Whole | None:
            nonlocal line
            edges = line_edges(data)
            if b"(" in data or b")" in data:
                runs, rest = find_runs(data, edges, line)
                self._runs += runs
                for name, key in _ELEMENT.findall(rest):
                    borders[name] |= {int(key or 0), int(key or 0) + 1}
            line += len(edges) - 1
            if len(self._runs) > MOST_STRETCHES:
                return Whole(why="the motions do not go to elements in turn", line=line)
            return None

        refused = self._go_through(path, take)
        for run in self._runs:
            borders[run.text[1]] |= {run.key, run.key + run.length}
        return refused

    def _sort_lines(self, data: bytes) -> WindowLines | Whole:
        comments = _COMMENT.finditer(data) if b"<!--" in data else ()
        odd = next((match.start(1) for match in comments if match[1]), None)
        if odd is not None:
            line = self.lines + 1 + data.count(b"\n", 0, odd)
            return Whole(why="a comment that is not one line", line=line)
        edges = line_edges(data)
        begins_plain = len(find_plain_points(data, edges[:2])) > 0
        self._opens = self._points.inside is None and not begins_plain
        found = self._points.find(data, edges)
        event, key = np.ones(len(edges) - 1, np.bool_), np.full(len(edges) - 1, NO_KEY)
        first = bisect_right(self._runs, self.lines - len(event), key=lambda run: run.line)
        for run in self._runs[max(first - 1, 0) :]:
            start = run.line - self.lines
            if start >= len(event):
                break
            event[max(start, 0) : max(start + run.length, 0)] = False
        rows = found[:, 0]
        event[rows] = False
        for row in np.flatnonzero(event).tolist():
            event[row] = bool(data[edges[row] : edges[row + 1]].strip())
        key[rows] = self._number_stretches(found)
        targets = (key != NO_KEY).astype(np.int64)
        return WindowLines(
            data=data, start=edges[:-1], end=edges[1:], targets=targets, opens=targets > 0,
            partial=np.zeros_like(event), event=event, key=key,
        )  # fmt: skip

    def _number_stretches(self, found: IntArray) -> IntArray:
        """Returns the number of the stretch of each of some points."""
        part = np.zeros(len(found), np.int64)
        for group in np.unique(found[:, 4]).tolist():
            mine = found[:, 4] == group
            borders = sorted(self._shared.borders[self._points.groups[group][0]])
            part[mine] = np.searchsorted(borders, found[mine, 2], side="right")
        columns = np.concatenate(
            [self._last_point, np.column_stack([found[:, 4], part, found[:, 2]])]
        )
        self._last_point = columns[-1:]
        begins = (np.diff(columns, axis=0) != [0, 0, 1]).any(axis=1)
        number = self._number + np.cumsum(begins)
        self._number = int(number[-1]) if len(number) else self._number
        return np.asarray(number)

    def _write(self, line: int, code: bytes, targets: int) -> None:
        self.shown += [(line, self.stretches)] * targets
        self._kept.append((line, code))

    def _note_ends(self) -> None:
        """Notes which elements the skeleton has."""
        text, points = b"\n".join(code for _, code in self._kept), _Points()
        found = points.find(text, line_edges(text))
        ends: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for (*_, key, _, group), (_, stretch) in zip(found.tolist(), self.shown, strict=False):
            ends[stretch].append((group, key))
        for one in ends.values():
            name, _ = points.groups[one[0][0]]
            self._shared.ends[name].append((one[0][1], one[-1][1]))

    @property
    def skeleton(self) -> bytes:
        """The text for the ordinary reader, in the lines of the file."""
        keys = {
            name: sorted({key for pair in ends for key in pair})
            for name, ends in self._shared.ends.items()
        }
        moves = [each for run in self._runs for each in run.show(keys.get(run.text[1], ()))]
        out, written = [], 0
        for line, code in sorted([*self._kept, *moves]):
            out.append(b"\n" * (line - written) + code + b"\n")
            written = line + 1
        return b"".join(out)

    def _cut(self, lines: WindowLines) -> None:
        """Begins chunks where they are due, and at windows without points."""
        super()._cut(lines)
        if self.size and self._opens and not lines.targets.any():
            count, known = self.targets, self._places
            self._cuts.append((self.size, self.lines, count))
            lead = max(int(np.searchsorted(known[:, 2], count - LEAD, side="right")) - 1, 0)
            self._leads.append(tuple(known[lead, :2].tolist()) if len(known) else (0, 0))

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the first and last point of every stretch cannot represent it, if so."""
        rows = skeleton.path[:, 1]
        if not self.targets:
            self._shared.computed |= bool((rows < 0).any())
        elif (rows < 0).any() or (len(rows) and (self._shared.computed or not _rises(skeleton))):
            return Whole(why="the motions do not go through the points in their order")
        ends = {name: np.array(sorted(some)) for name, some in self._shared.ends.items()}
        for name, some in ends.items():
            if (some[:-1, 1] >= some[1:, 0]).any():
                return Whole(why=f"an element of {name.decode()} is given twice")
        runs = [run for part in (*self._others, self) for run in part._runs]
        if not all(_is_given(run, ends.get(run.text[1])) for run in runs):
            return Whole(why="a motion to an element that is in no file")
        return super().judge(skeleton, others)


def _is_given(run: MoveRun, ends: IntArray | None) -> bool:
    """Returns whether all elements that motions go to are points of stretches (k, 2)."""
    if ends is None:
        return False
    mine = slice(*np.searchsorted(ends[:, 0], [run.key, run.key + run.length]).tolist())
    return int((ends[mine, 1] - ends[mine, 0] + 1).sum()) == run.length


def _rises(program: Program) -> bool:
    """Returns whether the path goes through the points in file order, but for axes at its ends."""
    rows = program.path[np.argsort(program.path[:, 0], kind="stable")][:, 1:]
    home = (rows[:, 1] == Motion.PTP) & (program.reason[rows[:, 0]] == Reason.JOINT_TARGET)
    inner = np.flatnonzero(~home)
    if not len(inner):
        return True
    own = rows[inner[0] : inner[-1] + 1, 0]
    ends = np.setdiff1d(rows[:, 0], own)
    outside = ((ends < own[0]) | (ends > own[-1])).all()
    return bool((np.diff(own) > 0).all() and outside)


class Val3Cutter:
    """Reads long ``.dtx`` files, and ``.pgx`` files, which have no points or have them, too."""

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a file of this name, not yet run."""
        return Val3Survey(name, targets)

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines, which begin with a point or outside of variables."""
        whole, edges = skeleton.program, line_edges(data)
        first = find_plain_points(data, edges[:2])
        inside = (b"", bool(first[0, 3])) if len(first) else None
        found = _Points(inside).find(data, edges)[: len(whole) and None]
        line, start, key, of_axes = found[:, :4].T
        line = line + 1
        points = PointValues(
            is_axis=of_axes.astype(bool).tolist(), name=[whole.name] * len(found),
            key=[*map(str, key.tolist())], start=start.tolist(), line=line.tolist(),
        )  # fmt: skip
        tokens = find_point_numbers(data, points, whole.name)
        position, rotation, axes = values_of(tokens)
        none = np.zeros(len(found), np.int64)
        program = Program(
            name=whole.name, dialect=whole.dialect, data=data, position=position,
            rotation=rotation, axes=axes, motion=none,
            reason=np.where(of_axes > 0, int(Reason.JOINT_TARGET), int(Reason.NONE)),
            words=np.empty((len(found), 0), np.int64), words_of="", line=line,
            frame=none, tool=none, T_base_frame=np.eye(4)[None], T_flange_tool=np.eye(4)[None],
            spans=tokens,
        )  # fmt: skip
        return ReadChunk(program)


CUTTER: Final = Val3Cutter()
