"""Notes of a reader on targets, in sentences with line numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray

TOLD: Final = 5
"""Lines named one by one before the others are counted."""


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
        self._all: list[str] = []

    def say(self, sentence: str) -> None:
        """Adds a whole sentence."""
        self._all.append(sentence)

    def rows(self, rows: BoolArray, what: str) -> None:
        """Adds the lines of some targets and what is true of them."""
        found = np.unique(self._line[np.flatnonzero(rows)]).tolist()
        if found:
            shown = ", ".join(str(each) for each in found[:TOLD])
            more = f" and {len(found) - TOLD} more lines" if len(found) > TOLD else ""
            self.say(f"{self._name}:{shown}{more}: {what}.")

    def each(self, found: list[tuple[int, str]], starts: IntArray) -> None:
        """Adds notes on (byte, what), each text once; ``starts`` are the first bytes of lines."""
        told: dict[str, list[int]] = {}
        for offset, what in found:
            told.setdefault(what, []).append(int(np.searchsorted(starts, offset, side="right")))
        for what, lines in told.items():
            more = f" ({len(lines)} times)" if len(lines) > 1 else ""
            self.say(f"{self._name}:{lines[0]}: {what}; it is not compensated{more}.")

    def notes(self) -> tuple[str, ...]:
        """Returns all sentences."""
        return tuple(dict.fromkeys(self._all))
