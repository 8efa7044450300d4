"""One pass over a long file: stretches, blocks, and the skeleton that stands for it.

A *stretch* is lines whose targets share all that statements decide; comments, and statements that
no target depends on, may stand between. In the skeleton a few targets stand for each stretch; all
its other lines are empty there, so that line numbers stay. Blocks begin with a target that leaves
nothing out.
"""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.stream import Block, Piece, Whole

WINDOW: Final = 1 << 23
"""Bytes looked at at a time."""
LEAD: Final = 256
"""Targets before a block that say where the arm comes from."""
MOST_STRETCHES: Final = 50_000
_LONGEST_LINE: Final = 1 << 26
_LONGEST_BLOCK: Final = 4  # times the targets asked for


class Lines(NamedTuple):
    """The lines of a window.

    Attributes:
        start: (l,) first byte of each.
        targets: (l,) how many stand in it.
        opens: (l,) a block may begin with it.
    """

    start: IntArray
    targets: IntArray
    opens: BoolArray


class Survey:
    """What is common to the surveys of all languages.

    Attributes:
        name: File name.
        size: Bytes so far.
        lines: Lines so far.
        targets: Targets so far.
        stretch: Zero-based line at which each stretch begins.
        shown: (line, stretch) of every target of the skeleton.
    """

    def __init__(self, name: str, targets: int) -> None:
        self.name, self._asked = name, targets
        self._hash = hashlib.sha256()
        self.size = self.lines = self.targets = 0
        self.stretch: list[int] = []
        self.shown: list[tuple[int, int]] = []
        self._skeleton: list[bytes] = []
        self._written = 0
        self._cuts: list[tuple[int, int, int]] = [(0, 0, 0)]  # byte, line, targets before
        self._leads: list[tuple[int, int]] = [(0, 0)]
        self._places = np.zeros((0, 3), np.int64)  # where a block might have begun, likewise

    @abstractmethod
    def _window(self, data: bytes) -> tuple[Lines, Whole | None]:
        """Returns the lines of a window, now in the skeleton, or why they cannot be."""

    def run(self, path: Path, window: int = WINDOW) -> Whole | None:
        """Goes through a file; returns why it must be read whole, if so.

        Raises:
            FormatError: The bytes are not in the dialect.
        """
        with path.open("rb") as stream:
            for data in _windows(stream, window):
                refused = self._take(data)
                if refused is not None:
                    return refused
        return self.close()

    @property
    def sha256(self) -> str:
        """Of the bytes."""
        return self._hash.hexdigest()

    @property
    def skeleton(self) -> bytes:
        """The text for the ordinary reader."""
        return b"".join(self._skeleton)

    def _take(self, data: bytes) -> Whole | None:
        self._hash.update(data)
        if len(data) > _LONGEST_LINE:
            return Whole(why="a line is longer than any controller reads", line=self.lines + 1)
        if b"\0" in data or (not self.size and _odd_head(data)):
            return Whole(why="the encoding is to be judged", line=self.lines + 1)
        found, refused = self._window(data)
        if refused is not None:
            return refused
        self._cut(found)
        self.size += len(data)
        self.lines += len(found.start)
        self.targets += int(found.targets.sum())
        since = self.targets - self._cuts[-1][2]
        if since > _LONGEST_BLOCK * self._asked:
            return Whole(
                why=f"{since} targets after it without one that leaves nothing out",
                line=self._cuts[-1][1] + 1,
            )
        return None

    def _represent(self, line: int, code: bytes) -> None:
        self.shown.append((self.lines + line, len(self.stretch) - 1))
        self._write(line, code)

    def _write(self, line: int, code: bytes) -> None:
        blank = self.lines + line - self._written
        self._skeleton.append(b"\n" * blank + code + b"\n")
        self._written += blank + 1

    def _cut(self, found: Lines) -> None:
        """Begins blocks where they are due."""
        may = np.flatnonzero(found.opens)
        before = self.targets + np.cumsum(found.targets) - found.targets
        places = np.column_stack([found.start[may] + self.size, may + self.lines, before[may]])
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

    def close(self) -> Whole | None:
        """Ends the pass; returns why the file must be read whole, if so."""
        if not self.targets:
            return Whole(why="no targets that stand in place or in arrays")
        return None

    def require_shown(self, lines: IntArray) -> Whole | None:
        """Returns why the skeleton's targets (zero-based lines) are not those it was given."""
        shown = np.array([line for line, _ in self.shown], np.int64)
        extra = np.setdiff1d(lines, shown)
        if len(extra) or not np.array_equal(lines, shown):
            at = int(extra[0]) + 1 if len(extra) else 0
            return Whole(why="a target that is stored or has clauses of its own", line=at)
        return None

    @property
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
