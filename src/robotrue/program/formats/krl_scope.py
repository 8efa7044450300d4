"""Scope of names: the file of a name that several ``.dat`` of a job define."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

_GIVEN: Final = re.compile(
    rb"^[ \t]*+(?:(?:GLOBAL|DECL|CONST)[^\S\n]++)*(?:\w++[^\S\n]++)?(\w++)"
    rb"[ \t]*+(?:\[[^\]\r\n]*+\][ \t]*+)?=(?!=)",
    re.IGNORECASE | re.MULTILINE,
)

_ROUTINE: Final = re.compile(
    rb"^[ \t]*+(GLOBAL[ \t]++)?DEF(?:FCT[ \t]++\w++(?:\[[^\]\r\n]*+\])?+)?[ \t]++(\w++)[ \t]*+\(",
    re.IGNORECASE | re.MULTILINE,
)


class Scope:
    """Names as the walk keeps them: with their file where more than one file has them.

    Attributes:
        owners: From which line of the main text on which file, by name without suffix, is read.
    """

    def __init__(self) -> None:
        self.owners: Sequence[tuple[int, str]] = ()
        self._shared: frozenset[str] = frozenset()
        self._file = ""
        self._stores: list[str] = []
        self._routines: dict[str, dict[str, bool]] = {}

    def share(self, stores: Iterable[bytes]) -> None:
        """Finds the names that several data files give a value to."""
        count: Counter[str] = Counter()
        for data in stores:
            count.update({name.decode("latin-1").lower() for name in _GIVEN.findall(data)})
        self._shared = frozenset(name for name, files in count.items() if files > 1)

    def enter(self, name: str) -> None:
        """Begins a data file."""
        self._file = (name.rpartition(".")[0] or name).lower()
        self._stores.append(self._file)

    def reach(self, line: int) -> None:
        """Comes to a line of the main text."""
        for first, stem in self.owners:
            if first <= line:
                self._file = stem.lower()

    @property
    def store(self) -> int:
        """Negative line number that represents the data file being read."""
        return -len(self._stores)

    def name_in(self, text: str, line: int) -> str:
        """Returns :meth:`name` as it is in a line of the main text, or in a data file."""
        lower = text.lower()
        if lower not in self._shared:
            return lower
        return f"{lower}@{self._stem(line)}"

    def _stem(self, line: int) -> str:
        if line < 0:
            return self._stores[-1 - line]
        at = bisect_right(self.owners, line, key=lambda owner: owner[0]) - 1
        return self.owners[at][1].lower() if at >= 0 else self._file

    def share_routines(self, mains: Iterable[tuple[str, bytes]]) -> None:
        """Finds the routines that several programs have, and which of them others can call."""
        for name, data in mains:
            stem = (name.rpartition(".")[0] or name).lower()
            for number, (shared, routine) in enumerate(_ROUTINE.findall(data)):
                lower = routine.decode("latin-1").lower()
                self._routines.setdefault(lower, {})[stem] = not number or bool(shared)

    def has_routine(self, name: str) -> bool:
        """Returns whether a program of the job has a routine, see :meth:`routine`."""
        return name.partition("@")[0] in self._routines

    def routine(self, text: str, line: int) -> str:
        """Returns a routine's name in lower case, after that of its file where others have it."""
        lower = text.lower()
        files = self._routines.get(lower, {})
        if len(files) < 2:
            return lower
        own = self._stem(line)
        shared = [stem for stem, called in files.items() if called]
        stem = own if own in files else shared[0] if len(shared) == 1 else ""
        return f"{lower}@{stem}"

    def name(self, text: str) -> str:
        """Returns a name in lower case, after that of its file where others have it, too."""
        lower = text.lower()
        return f"{lower}@{self._file}" if lower in self._shared else lower
