"""Notes of a reader on targets, in sentences with line numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.line_note import TOLD, LineNote


def absent_routine(place: str, names: Sequence[str], what: str) -> str:
    """Returns the sentence on called routines in no given file.

    Args:
        place: File, and line of the first call.
        names: As the program writes them.
        what: What they may change, and what is therefore left alone.
    """
    shown = ", ".join(names[:TOLD]) + (" and others" if len(names) > TOLD else "")
    listed = json.dumps(list(names[:TOLD]), ensure_ascii=False)
    return (
        f"{place}: {shown or 'a routine'} is in no file given and may change {what}. Give its "
        "file, too; if it changes none of them, state in the cell: [controller] "
        f"harmless_routines = {listed}."
    )


class TargetNotes:
    """Sentences for the user, each once."""

    def __init__(self, name: str, line: IntArray) -> None:
        self._name, self._line = name, line
        self._all: list[str | LineNote] = []

    def say(self, sentence: str) -> None:
        """Adds a whole sentence."""
        self._all.append(sentence)

    def rows(self, rows: BoolArray, what: str) -> None:
        """Adds the lines of some targets and what is true of them."""
        if rows.any():
            found = np.unique(self._line[rows])
            self._all.append(LineNote(lines=found, count=len(found), what=what))

    def each(self, found: list[tuple[int, str]], starts: IntArray) -> None:
        """Adds notes on (byte, what), each text once; ``starts`` are the first bytes of lines."""
        told: dict[str, list[int]] = {}
        for offset, what in found:
            told.setdefault(what, []).append(int(np.searchsorted(starts, offset, side="right")))
        for what, lines in told.items():
            at = np.array(lines)
            self._all.append(LineNote(lines=at, count=len(at), what=what, first=True))

    def notes(self) -> tuple[str, ...]:
        """Returns all sentences."""
        sentences = (
            each if isinstance(each, str) else each.sentence(self._name) for each in self._all
        )
        return tuple(dict.fromkeys(sentences))

    def on_lines(self) -> tuple[LineNote, ...]:
        """Returns those on lines."""
        return tuple(each for each in self._all if isinstance(each, LineNote))
