"""One pass over a long file: stretches, chunks, and the skeleton that represents it.

A *stretch* is lines whose targets share all settings of statements; comments, and statements that
no target depends on, may be between them. In the skeleton a line represents each stretch, or its
first and last one where it is stored points; all its other lines are empty there, so that line
numbers stay. Chunks start with a target that leaves nothing out.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, ClassVar, Final, NamedTuple

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.program import FrameTable, Motion, Program
from robotrue.program.program_chunk import ChunkLines, ProgramChunk, Splice, Whole

WINDOW: Final = 1 << 23
"""Bytes looked at at a time."""
LEAD: Final = 256
"""Targets before a chunk that determine the arm's state at its start."""
MOST_STRETCHES: Final = 50_000
NO_KEY: Final = -1
_LONGEST_LINE: Final = 1 << 26
LONGEST_CHUNK: Final = 4
"""Times the requested targets."""


class WindowLines(NamedTuple):
    """The l lines of a window.

    Attributes:
        data: Its bytes.
        start: (l,) first byte of each line.
        end: (l,) byte after the last of its code.
        targets: (l,) number of its targets.
        opens: (l,) a chunk may begin with it.
        partial: (l,) no stretch may begin with it.
        event: (l,) it may matter to the targets after it: the skeleton has it, a stretch ends.
        key: (l,) the same for all targets of a stretch, ``NO_KEY`` where there is none.
    """

    data: bytes
    start: IntArray
    end: IntArray
    targets: IntArray
    opens: BoolArray
    partial: BoolArray
    event: BoolArray
    key: IntArray

    def code(self, line: int) -> bytes:
        """Returns the text of a line."""
        return self.data[self.start[line] : self.end[line]].rstrip(b"\r\n")


class Survey(ABC):
    """Base of the surveys of all languages.

    Attributes:
        name: File name.
        size: Bytes so far.
        lines: Lines so far.
        targets: Targets so far.
        stretches: Stretches so far.
        shown: Zero-based line, and number of its stretch, of every target of the skeleton.
    """

    events: ClassVar[str]
    """What lines that end a stretch are called."""
    stored: ClassVar[bool] = False
    """The targets are stored points."""

    def __init__(self, name: str, targets: int) -> None:
        self.name, self._asked = name, targets
        self._hash = hashlib.sha256()
        self.size = self.lines = self.targets = self.stretches = self._events = 0
        self._key = NO_KEY
        self._last: tuple[int, bytes] | None = None  # last line of the stretch that is open
        self.shown: list[tuple[int, int]] = []
        self._skeleton: list[bytes] = []
        self._written = 0
        self._cuts: list[tuple[int, int, int]] = [(0, 0, 0)]  # byte, line, targets before
        self._leads: list[tuple[int, int]] = [(0, 0)]
        self._places = np.zeros((0, 3), np.int64)  # possible starts of chunks, likewise

    @abstractmethod
    def _sort_lines(self, data: bytes) -> WindowLines | Whole:
        """Returns the lines of a window, or why they cannot be cut."""

    def _find_end(self, data: bytes) -> int:
        """Returns the byte after the last line that a window can end with; 0 without one."""
        return data.rfind(b"\n") + 1

    def _stand_in(self, lines: WindowLines, line: int) -> tuple[bytes, int]:
        """Returns the code that represents a stretch that starts with a line, and its targets."""
        return lines.code(line), int(lines.targets[line])

    @property
    def parts(self) -> Mapping[str, Survey]:
        """The surveys of the files of the job that are cut, by file name."""
        return {self.name: self}

    def run(self, path: Path, beside: Sequence[Path] = ()) -> Whole | None:
        """Goes through a file; returns why it cannot be cut, if so.

        Args:
            path: The file.
            beside: The other files of its job that lie next to it because of its name.

        Raises:
            FormatError: The bytes are not in the dialect.
        """
        refused = self._go_through(path, self._take_window)
        if refused is not None:
            return refused
        self._end_stretch()
        return self._check_end()

    def _go_through(self, path: Path, take: Callable[[bytes], Whole | None]) -> Whole | None:
        """Takes the windows of a file; returns why it cannot be cut, if so."""
        with path.open("rb") as stream:
            for data in _windows(stream, WINDOW, self._find_end):
                refused = take(data)
                if refused is not None:
                    return refused
        return None

    @property
    def sha256(self) -> str:
        """SHA-256 of the bytes."""
        return self._hash.hexdigest()

    @property
    def skeleton(self) -> bytes:
        """The text for the ordinary reader."""
        return b"".join(self._skeleton)

    def _take_window(self, data: bytes) -> Whole | None:
        self._hash.update(data)
        if len(data) > _LONGEST_LINE:
            return Whole(why="a line is longer than any controller reads", line=self.lines + 1)
        if b"\0" in data or (not self.size and data.startswith((b"\xff\xfe", b"\xfe\xff"))):
            return Whole(why="the encoding must be checked", line=self.lines + 1)
        lines = self._sort_lines(data)
        if isinstance(lines, Whole):
            return lines
        refused = self._write_window(lines)
        if refused is not None:
            return refused
        self._cut(lines)
        self.size += len(data)
        self.lines += len(lines.start)
        self.targets += int(lines.targets.sum())
        since = self.targets - self._cuts[-1][2]
        if since > LONGEST_CHUNK * self._asked:
            return Whole(
                why=f"{since} targets after it without a complete one",
                line=self._cuts[-1][1] + 1,
            )
        return None

    def _write_window(self, lines: WindowLines) -> Whole | None:
        """Writes the statements and the stretches of a window into the skeleton."""
        marks = np.flatnonzero(lines.event | (lines.key != NO_KEY))
        keys = np.append(self._key, np.where(lines.event, NO_KEY, lines.key)[marks])
        differs = lines.event[marks] | (keys[1:] != keys[:-1])
        self._key = int(keys[-1])
        lost = marks[differs & lines.partial[marks]]
        if len(lost):
            why = "a target leaves components out that no motion just before it gives"
            return Whole(why=why, line=self.lines + int(lost[0]) + 1)
        self._events += int(lines.event.sum())
        changes = np.flatnonzero(differs)
        if max(self._events, self.stretches + len(changes)) > MOST_STRETCHES:
            return Whole(why=f"more than {MOST_STRETCHES} {self.events}", line=self.lines + 1)
        since = 0
        for place in [*changes.tolist(), len(marks)]:
            if self.stored and place > since:
                last = int(marks[place - 1])
                self._last = (self.lines + last, lines.code(last))
            since = place + 1
            if place < len(marks):
                self._end_stretch()
                self._begin_stretch(lines, int(marks[place]))
        return None

    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        code, targets = lines.code(line), 0
        if not lines.event[line]:
            self.stretches += 1
            code, targets = self._stand_in(lines, line)
        self._write(self.lines + line, code, targets)

    def _end_stretch(self) -> None:
        """Writes the last of several stored points into the skeleton."""
        if self._last is not None:
            self._write(*self._last, 1)
        self._last = None

    def _write(self, line: int, code: bytes, targets: int) -> None:
        self.shown += [(line, self.stretches)] * targets
        self._skeleton.append(b"\n" * (line - self._written) + code + b"\n")
        self._written = line + 1

    def _cut(self, lines: WindowLines) -> None:
        """Begins chunks where they are due."""
        may = np.flatnonzero(lines.opens)
        before = self.targets + np.cumsum(lines.targets) - lines.targets
        places = np.column_stack([lines.start[may] + self.size, may + self.lines, before[may]])
        places = places.astype(np.int64)
        known = np.concatenate([self._places, places])
        while True:
            at = int(np.searchsorted(places[:, 2], self._cuts[-1][2] + self._asked))
            if at >= len(places):
                break
            byte, line, count = places[at].tolist()
            self._cuts.append((byte, line, count))
            lead = max(int(np.searchsorted(known[:, 2], count - LEAD, side="right")) - 1, 0)
            self._leads.append((int(known[lead, 0]), int(known[lead, 1])))
        self._places = known[-4 * LEAD :]

    def locate(self, line: int) -> int:
        """Returns the line of the file that a line of the skeleton is; both are one-based."""
        return line

    def splice(self) -> Splice | None:
        """Returns the text that chunks are read together with; None if they need none."""
        return None

    def _check_end(self) -> Whole | None:
        """Returns why the whole file cannot be cut, if so."""
        if not self.targets:
            return Whole(why="no targets in moves or in arrays")
        return None

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the targets of the skeleton cannot represent the others, if so.

        Args:
            skeleton: As the ordinary reader reads it.
            others: The other files of the job.
        """
        if skeleton.held.any():
            return Whole(why="the robot carries the part")
        shown, stretch = np.array(self.shown, np.int64).reshape(-1, 2).T
        if not np.array_equal(skeleton.line - 1, shown):
            extra = np.setdiff1d(skeleton.line - 1, shown)
            at = int(extra[0]) + 1 if len(extra) else 0
            return Whole(why="a target that is stored or has its own clauses", line=at)
        # No frame is in force where no motion goes.
        frames = np.column_stack([skeleton.frame, skeleton.tool])
        frames[skeleton.motion == Motion.UNUSED] = -1
        use = np.column_stack([skeleton.reason, frames, skeleton.motion])
        if self.stored and ((use[1:] != use[:-1]).any(axis=1) & (np.diff(stretch) == 0)).any():
            return Whole(why="points of one array are used in different ways")
        return None

    def _add_targets(self, line: IntArray) -> None:
        """Counts targets of the skeleton on zero-based lines (k,), rising, that were not."""
        self.targets += len(line)
        self._cuts = [
            (byte, at, count + int(np.searchsorted(line, at))) for byte, at, count in self._cuts
        ]

    def notes(self, skeleton: Program) -> tuple[str, ...]:
        """Returns the notes of the reader on the file, from those on the skeleton."""
        return skeleton.notes

    @property
    def chunks(self) -> tuple[ProgramChunk, ...]:
        """The chunks of the file."""
        ends = [*self._cuts[1:], (self.size, self.lines, self.targets)]
        return tuple(
            ProgramChunk(
                lines=ChunkLines(start, end, line),
                lead=ChunkLines(lead, start, lead_line),
                first=first,
                targets=after - first,
            )
            for (start, line, first), (end, _, after), (lead, lead_line) in zip(
                self._cuts, ends, self._leads, strict=True
            )
        )


class PlacedSurvey(Survey):
    """Base of surveys whose chunks are read in the skeleton, which has no empty lines."""

    def __init__(self, name: str, targets: int, frames: FrameTable) -> None:
        super().__init__(name, targets)
        self._frames = frames
        self._at: list[int] = []

    def _write(self, line: int, code: bytes, targets: int) -> None:
        self._written = line
        super()._write(line, code, targets)
        self._at.append(line)

    def locate(self, line: int) -> int:
        """Returns the line of the file that a line of the skeleton is; both are one-based."""
        return self._at[min(line, len(self._at)) - 1] + 1 if self._at else line

    def splice(self) -> Splice:
        """Returns the text that chunks are read together with."""
        edge, line = np.cumsum([0, *map(len, self._skeleton)]), np.array(self._at, np.int64)
        return Splice(text=self.skeleton, edge=edge, line=line, frames=self._frames)


def _windows(stream: BinaryIO, window: int, find_end: Callable[[bytes], int]) -> Iterator[bytes]:
    """Yields the bytes in windows of whole lines."""
    rest = b""
    while chunk := stream.read(window):
        data = rest + chunk
        cut = find_end(data)
        if cut:
            yield data[:cut]
        rest = data[cut:]
    if rest:
        yield rest
