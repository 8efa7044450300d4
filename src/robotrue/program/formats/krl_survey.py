"""One pass over a long KRL file: stretches, blocks, and the skeleton that stands for it.

A *stretch* is lines whose targets share all that statements decide; comments, and statements that
no target depends on, may stand between. In the skeleton a few targets stand for each stretch; all
its other lines are empty there, so that line numbers stay. Blocks begin with a target that leaves
nothing out.
"""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.krl_scan import INLINE_ARC, Scan, scan
from robotrue.program.stream import Block, Piece, Whole

LEAD: Final = 256
"""Targets before a block that say where the arm comes from."""
MOST_STRETCHES: Final = 50_000
_LONGEST_LINE: Final = 1 << 26
_LONGEST_BLOCK: Final = 4  # times the targets asked for

NOTHING, FULL, PARTIAL, ODD, MIXED = 0, 1, 2, 3, 4
"""What a line holds: no plain motion; one that leaves nothing out; one that leaves something out;
one that is computed; an arc with axis values."""


class Survey:
    """What is common to the surveys of motions and of stored points.

    Attributes:
        name: File name.
        size: Bytes so far.
        lines: Lines so far.
        targets: Targets so far.
        stretch: Zero-based line at which each stretch begins.
        shown: (line, stretch) of every target of the skeleton.
        away: An external axis is away from zero.
        still: All targets have the same external values.
    """

    def __init__(self, name: str, targets: int) -> None:
        self.name, self._asked = name, targets
        self._hash = hashlib.sha256()
        self.size = self.lines = self.targets = 0
        self.away, self.still = False, True
        self.stretch: list[int] = []
        self.shown: list[tuple[int, int]] = []
        self._first_external: Array = np.full(6, np.nan)
        self._skeleton: list[bytes] = []
        self._written = 0
        self._cuts: list[tuple[int, int, int]] = [(0, 0, 0)]  # byte, line, targets before
        self._leads: list[tuple[int, int]] = [(0, 0)]
        self._places = np.zeros((0, 3), np.int64)  # of the last full targets, likewise

    @abstractmethod
    def _sorted(self, found: Scan) -> tuple[IntArray, IntArray, bool, bool]:
        """Returns targets and kind of every line of a window, external away, external still."""

    @abstractmethod
    def _stretches(self, found: Scan, kind: IntArray) -> Whole | None:
        """Adds the lines of a window to the skeleton; returns why it cannot, if so."""

    @property
    def sha256(self) -> str:
        """Of the bytes."""
        return self._hash.hexdigest()

    @property
    def skeleton(self) -> bytes:
        """The text for the ordinary reader."""
        return b"".join(self._skeleton)

    def take(self, data: bytes) -> Whole | None:
        """Adds a window; returns why the file must be read whole, if so."""
        self._hash.update(data)
        if len(data) > _LONGEST_LINE:
            return Whole(why="a line is longer than any controller reads", line=self.lines + 1)
        if self.size + len(data) >= 2**40 or b"\0" in data or (not self.size and _odd_head(data)):
            return Whole(why="the encoding is to be judged", line=self.lines + 1)
        found = self._scanned(data)
        rows, kind, away, still = self._sorted(found)
        self.away |= away
        self.still &= still
        refused = self._stretches(found, kind)
        self._cut(found, rows, kind)
        self.size += len(data)
        self.lines += len(found.line_kind)
        self.targets += int(rows.sum())
        since = self.targets - self._cuts[-1][2]
        if refused is None and since > _LONGEST_BLOCK * self._asked:
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

    def _represent(self, line: int, code: bytes) -> None:
        self.shown.append((self.lines + line, len(self.stretch) - 1))
        self._write(line, code)

    def _write(self, line: int, code: bytes) -> None:
        blank = self.lines + line - self._written
        self._skeleton.append(b"\n" * blank + code + b"\n")
        self._written += blank + 1

    def _cut(self, found: Scan, rows: IntArray, kind: IntArray) -> None:
        """Begins blocks where they are due."""
        may = np.flatnonzero((kind == FULL) & (found.line_kind != INLINE_ARC))
        before = self.targets + np.cumsum(rows) - rows
        places = np.column_stack(
            [found.line_start[may] + self.size, may + self.lines, before[may]]
        ).astype(np.int64)
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

    def external_at_rest(self, at_rest: bool) -> Whole | None:
        """Returns why the external axes ask for the whole file, if they do."""
        if self.away and not (at_rest and self.still):
            return Whole(why="external axes are away from zero")
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
