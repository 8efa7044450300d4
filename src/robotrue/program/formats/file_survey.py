"""One pass over a long file: stretches, chunks, and the skeleton that stands for it.

A *stretch* is lines whose targets share all that statements decide; comments, and statements that
no target depends on, may stand between. In the skeleton a few targets stand for each stretch; all
its other lines are empty there, so that line numbers stay. Chunks begin with a target that leaves
nothing out.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, ClassVar, Final, NamedTuple

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.program import Program
from robotrue.program.program_chunk import ChunkLines, ProgramChunk, Whole

WINDOW: Final = 1 << 23
"""Bytes looked at at a time."""
LEAD: Final = 256
"""Targets before a chunk that say where the arm comes from."""
MOST_STRETCHES: Final = 50_000
_LONGEST_LINE: Final = 1 << 26
_LONGEST_CHUNK: Final = 4  # times the targets asked for


class WindowLines(NamedTuple):
    """The l lines of a window.

    Attributes:
        data: Its bytes.
        start: (l,) first byte of each line.
        end: (l,) byte after the last of its code.
        targets: (l,) how many targets stand in it.
        opens: (l,) a chunk may begin with it.
        event: (l,) it may matter to the targets after it: the skeleton has it, a stretch ends.
        begins: (l,) it is plain, and the first of its stretch.
    """

    data: bytes
    start: IntArray
    end: IntArray
    targets: IntArray
    opens: BoolArray
    event: BoolArray
    begins: BoolArray

    def code(self, line: int) -> bytes:
        """Returns the text of a line."""
        return self.data[self.start[line] : self.end[line]].rstrip(b"\r\n")


class Survey(ABC):
    """What is common to the surveys of all languages.

    Attributes:
        name: File name.
        size: Bytes so far.
        lines: Lines so far.
        targets: Targets so far.
        stretch: Zero-based line at which each stretch begins.
        shown: (line, stretch) of every target of the skeleton.
    """

    events: ClassVar[str]
    """What lines that end a stretch are called."""

    def __init__(self, name: str, targets: int) -> None:
        self.name, self._asked = name, targets
        self._hash = hashlib.sha256()
        self.size = self.lines = self.targets = self._events = 0
        self.stretch: list[int] = []
        self.shown: list[tuple[int, int]] = []
        self._skeleton: list[bytes] = []
        self._written = 0
        self._cuts: list[tuple[int, int, int]] = [(0, 0, 0)]  # byte, line, targets before
        self._leads: list[tuple[int, int]] = [(0, 0)]
        self._places = np.zeros((0, 3), np.int64)  # where a chunk might have begun, likewise

    @abstractmethod
    def _sort_lines(self, data: bytes) -> WindowLines | Whole:
        """Returns the lines of a window, or why they cannot be cut."""

    @abstractmethod
    def _begin_stretch(self, lines: WindowLines, line: int) -> None:
        """Writes what stands for a stretch, from its first line, into the skeleton."""

    def _continue_stretch(self, lines: WindowLines, since: int, until: int) -> None:
        """Looks at the lines after the begin of a stretch, in one window."""
        return

    def _end_stretch(self) -> None:
        """Writes what still stands for a stretch into the skeleton."""
        return

    def run(self, path: Path) -> Whole | None:
        """Goes through a file; returns why it cannot be cut, if so.

        Raises:
            FormatError: The bytes are not in the dialect.
        """
        with path.open("rb") as stream:
            for data in _windows(stream, WINDOW):
                refused = self._take_window(data)
                if refused is not None:
                    return refused
        self._end_stretch()
        return self._check_end()

    @property
    def sha256(self) -> str:
        """Of the bytes."""
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
            return Whole(why="the encoding is to be judged", line=self.lines + 1)
        lines = self._sort_lines(data)
        if isinstance(lines, Whole):
            return lines
        self._events += int(lines.event.sum())
        if max(self._events, len(self.stretch) + int(lines.begins.sum())) > MOST_STRETCHES:
            return Whole(why=f"more than {MOST_STRETCHES} {self.events}", line=self.lines + 1)
        self._write_window(lines)
        self._cut(lines)
        self.size += len(data)
        self.lines += len(lines.start)
        self.targets += int(lines.targets.sum())
        since = self.targets - self._cuts[-1][2]
        if since > _LONGEST_CHUNK * self._asked:
            return Whole(
                why=f"{since} targets after it without one that leaves nothing out",
                line=self._cuts[-1][1] + 1,
            )
        return None

    def _write_window(self, lines: WindowLines) -> None:
        """Writes the statements and the stretches of a window into the skeleton."""
        since = 0
        for mark in np.flatnonzero(lines.event | lines.begins).tolist():
            self._continue_stretch(lines, since, mark)
            self._end_stretch()
            if lines.event[mark]:
                self._write(mark, lines.code(mark))
            else:
                self.stretch.append(self.lines + mark)
                self._begin_stretch(lines, mark)
            since = mark + 1
        self._continue_stretch(lines, since, len(lines.start))

    def _represent(self, line: int, code: bytes, targets: int = 1) -> None:
        """Writes targets that stand for the last stretch into the skeleton."""
        self.shown += [(self.lines + line, len(self.stretch) - 1)] * targets
        self._write(line, code)

    def _write(self, line: int, code: bytes) -> None:
        blank = self.lines + line - self._written
        self._skeleton.append(b"\n" * blank + code + b"\n")
        self._written += blank + 1

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

    def _check_end(self) -> Whole | None:
        """Returns why the whole file cannot be cut, if so."""
        if not self.targets:
            return Whole(why="no targets that stand in place or in arrays")
        return None

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the rule of every stretch, ``ChunkRules.table``, or why there is none.

        Args:
            skeleton: As the ordinary reader reads it.
            others: The other files of the job.
        """
        if skeleton.held.any():
            return Whole(why="the robot carries the part")
        shown = np.array([line for line, _ in self.shown], np.int64)
        if not np.array_equal(skeleton.line - 1, shown):
            extra = np.setdiff1d(skeleton.line - 1, shown)
            at = int(extra[0]) + 1 if len(extra) else 0
            return Whole(why="a target that is stored or has its own clauses", line=at)
        stretch = self._shown_stretch
        table = np.full((len(self.stretch), 5), -1)
        table[stretch, 0], table[stretch, 1] = skeleton.frame, skeleton.tool
        table[stretch, reason_column(skeleton)] = skeleton.reason
        return table

    @property
    def _shown_stretch(self) -> IntArray:
        """(t,) stretch of every target of the skeleton."""
        return np.array([number for _, number in self.shown], np.int64)

    @property
    def chunks(self) -> tuple[ProgramChunk, ...]:
        """The chunks of the file."""
        ends = [*self._cuts[1:], (self.size, self.lines, self.targets)]
        return tuple(
            ProgramChunk(
                lines=self._chunk_lines(start, end, line, last),
                lead=self._chunk_lines(lead, start, lead_line, line),
                first=first,
                targets=after - first,
            )
            for (start, line, first), (end, last, after), (lead, lead_line) in zip(
                self._cuts, ends, self._leads, strict=True
            )
        )

    def _chunk_lines(self, start: int, end: int, line: int, last: int) -> ChunkLines:
        begins = np.array(self.stretch, np.int64)
        first = max(int(np.searchsorted(begins, line, side="right")) - 1, 0)
        until = max(int(np.searchsorted(begins, last)), first + 1)
        return ChunkLines(
            start=start,
            end=end,
            line=line,
            rule_from=begins[first:until],
            rule=np.arange(first, min(until, len(begins))),
        )


def reason_column(program: Program) -> IntArray:
    """Returns (n,) the column of ``ChunkRules.table`` for the reason of each target."""
    axis_targets = np.isfinite(program.axes).any(axis=1)
    return np.where(axis_targets, 3, 2)


def _windows(stream: BinaryIO, window: int) -> Iterator[bytes]:
    """Yields the bytes in windows of whole lines."""
    rest = b""
    while chunk := stream.read(window):
        data = rest + chunk
        cut = data.rfind(b"\n") + 1
        if cut:
            yield data[:cut]
        rest = data[cut:]
    if rest:
        yield rest
