"""What is to be said of some targets: a sentence that begins with their lines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from robotrue.core.arrays import IntArray
from robotrue.program.program import Program

NAMED: Final = 5
"""Lines a note names; the rest are counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowNote:
    """A sentence about targets of one program.

    Attributes:
        lines: The first ``NAMED`` lines, one-based.
        count: How many targets there are.
        text: What is said of them; ``%.0f`` stands for ``worst``.
        worst: Largest value among them, if the text names one.
        rank: Place of the note among others.
    """

    lines: tuple[int, ...]
    count: int
    text: str
    worst: float | None = None
    rank: int = 0

    def __str__(self) -> str:
        lines = ", ".join(str(line) for line in self.lines)
        tail = f", ... ({self.count} in all)" if self.count > len(self.lines) else ""
        text = self.text if self.worst is None else self.text % self.worst
        return f"line{'s' if self.count > 1 else ''} {lines}{tail}: {text}"


def row_note(
    program: Program, rows: IntArray, text: str, *, worst: float | None = None, rank: int = 0
) -> RowNote:
    """Returns the note on some rows of a program, in file order."""
    lines = tuple(int(program.line[row]) for row in rows[:NAMED])
    return RowNote(lines=lines, count=len(rows), text=text, worst=worst, rank=rank)


def merge_notes(notes: Iterable[RowNote]) -> tuple[RowNote, ...]:
    """Returns notes that say the same as one each, by rank, from parts of a program in order."""
    merged: dict[tuple[int, str], RowNote] = {}
    for note in notes:
        key = (note.rank, note.text)
        before = merged.get(key)
        if before is None:
            merged[key] = note
            continue
        worst = note.worst
        if before.worst is not None and worst is not None:
            worst = max(before.worst, worst)
        merged[key] = replace(
            before,
            lines=(before.lines + note.lines)[:NAMED],
            count=before.count + note.count,
            worst=worst,
        )
    return tuple(merged[key] for key in sorted(merged, key=lambda key: key[0]))
