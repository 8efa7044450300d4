"""Statements of a KRL job that set ``BASE_DATA[n]`` or ``TOOL_DATA[n]``, and what they leave open.

The data are the controller's, and keep their values from program to program and from run to run.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Final

from robotrue.program.external_axes import plain_key

_SET: Final = re.compile(
    r"\s*+(BASE|TOOL)_DATA\s*+\[([^\]]*+)\]((?:\s*+\.\s*+\w++)?)\s*+=(?!=)(.*)", re.IGNORECASE
)
_DEF: Final = re.compile(r"\s*+(?:GLOBAL\s++)?DEF(?:FCT)?\b", re.IGNORECASE)


class StoredData:
    """Lines that set numbered frames and tools, with the texts they set."""

    def __init__(self) -> None:
        self._lines: dict[tuple[str, str], list[int]] = defaultdict(list)
        self._texts: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._routines: dict[tuple[str, str], set[int]] = defaultdict(set)

    def add(self, statements: Iterable[tuple[int, str]]) -> None:
        """Enters those of the statements (zero-based line, code) that set one, in rising order."""
        begin = 0
        for line, code in statements:
            begin = line if _DEF.match(code) else begin
            match = _SET.match(code)
            if match:
                number = match[2].strip()
                key = match[1].lower(), plain_key(number) if number.isdecimal() else ""
                text = "".join(match[4].lower().split())
                plain = text.startswith("{") and not match[3]
                self._lines[key].append(line)
                self._routines[key].add(begin)
                self._texts[key].add(text if plain else str(line))

    def may_differ(
        self, side: str, number: str, line: int, begin: int, calls: Sequence[int]
    ) -> bool:
        """Returns whether a numbered frame may have another value than the last one set above.

        Args:
            side: ``base`` or ``tool``.
            number: Without leading zeros.
            line: Where it is used.
            begin: First line of the routine of that line.
            calls: Lines that call a routine of the job, rising.
        """
        lines = self._lines.get((side, number), [])
        if (side, "") in self._lines or not lines:
            return (side, "") in self._lines
        above = bisect_right(lines, line)
        own = above > 0 and lines[above - 1] >= begin
        if len(self._texts[side, number]) == 1:
            return above < len(lines) and not own
        if not own:
            return True
        call = bisect_right(calls, lines[above - 1])
        called = call < len(calls) and calls[call] < line
        return called and len(self._routines[side, number]) > 1
