"""Notes of a reader on lines of a program, which are joined over the chunks of a long one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray

TOLD: Final = 5
"""Lines named one by one before the others are counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineNote:
    """A cause that targets of some lines are left alone.

    Attributes:
        lines: (k,) one-based lines, rising; of a joined note only the first ``TOLD``.
        count: Number of lines.
        what: Clause about them.
        first: Only the first line is named.
    """

    lines: IntArray
    count: int
    what: str
    first: bool = False

    def sentence(self, name: str) -> str:
        """Returns the note on a file of this name."""
        if self.first:
            more = f" ({self.count} times)" if self.count > 1 else ""
            return f"{name}:{self.lines[0]}: {self.what}; it is not compensated{more}."
        shown = ", ".join(map(str, self.lines[:TOLD].tolist()))
        more = f" and {self.count - TOLD} more lines" if self.count > TOLD else ""
        return f"{name}:{shown}{more}: {self.what}."


def cut_note(note: LineNote, after: int, count: int, shift: int) -> LineNote:
    """Returns the note on ``count`` lines ``after`` others, with ``shift`` added to each."""
    lines = note.lines[(note.lines > after) & (note.lines <= after + count)] + shift
    return replace(note, lines=lines, count=len(lines))


def join_notes(notes: Iterable[LineNote]) -> tuple[LineNote, ...]:
    """Returns one note for each cause, from parts of a program in order."""
    joined: dict[tuple[str, bool], LineNote] = {}
    for note in notes:
        before = joined.get((note.what, note.first), replace(note, lines=note.lines[:0], count=0))
        joined[note.what, note.first] = replace(
            note,
            lines=np.concatenate([before.lines, note.lines])[:TOLD],
            count=before.count + note.count,
        )
    return tuple(note for note in joined.values() if note.count)
