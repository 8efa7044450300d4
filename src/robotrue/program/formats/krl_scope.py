"""Which file a name belongs to where several ``.dat`` of a job give it a value."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

_GIVEN: Final = re.compile(
    rb"^[ \t]*+(?:(?:GLOBAL|DECL|CONST)[^\S\n]++)*(?:\w++[^\S\n]++)?(\w++)"
    rb"[ \t]*+(?:\[[^\]\r\n]*+\][ \t]*+)?=(?!=)",
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

    def share(self, stores: Iterable[bytes]) -> None:
        """Finds the names that several data files give a value to."""
        count: Counter[str] = Counter()
        for data in stores:
            count.update({name.decode("latin-1").lower() for name in _GIVEN.findall(data)})
        self._shared = frozenset(name for name, files in count.items() if files > 1)

    def enter(self, name: str) -> None:
        """Begins a data file."""
        self._file = (name.rpartition(".")[0] or name).lower()

    def reach(self, line: int) -> None:
        """Comes to a line of the main text."""
        for first, stem in self.owners:
            if first <= line:
                self._file = stem.lower()

    def name(self, text: str) -> str:
        """Returns a name in lower case, behind that of its file where others have it, too."""
        lower = text.lower()
        return f"{lower}@{self._file}" if lower in self._shared else lower
