"""What the surveys of KRL motions and of KRL points share: the scanner, and external axes."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.krl_scan import INLINE_ARC, Scan, scan
from robotrue.program.formats.long_survey import Lines, Survey
from robotrue.program.stream import Whole

NOTHING, FULL, PARTIAL, ODD, MIXED = 0, 1, 2, 3, 4
"""What a line holds: no plain motion; one that leaves nothing out; one that leaves something out;
one that is computed; an arc with axis values."""


class KrlSurvey(Survey):
    """One pass over a KRL file.

    Attributes:
        away: An external axis is away from zero.
        still: All targets have the same external values.
    """

    def __init__(self, name: str, targets: int) -> None:
        super().__init__(name, targets)
        self.away, self.still = False, True
        self._first_external: Array = np.full(6, np.nan)

    @abstractmethod
    def _sorted(self, found: Scan) -> tuple[IntArray, IntArray, bool, bool]:
        """Returns targets and kind of every line of a window, external away, external still."""

    @abstractmethod
    def _stretches(self, found: Scan, kind: IntArray) -> Whole | None:
        """Adds the lines of a window to the skeleton; returns why it cannot, if so."""

    def _window(self, data: bytes) -> tuple[Lines, Whole | None]:
        found = self._scanned(data)
        rows, kind, away, still = self._sorted(found)
        self.away |= away
        self.still &= still
        opens = np.asarray((kind == FULL) & (found.line_kind != INLINE_ARC))
        return Lines(found.line_start.astype(np.int64), rows, opens), self._stretches(found, kind)

    def _scanned(self, data: bytes) -> Scan:
        try:
            return scan(data, name=self.name)
        except FormatError as cause:
            line = None if cause.line is None else cause.line + self.lines
            raise FormatError(cause.message, source=self.name, line=line, hint=cause.hint) from None

    def external_at_rest(self, at_rest: bool) -> Whole | None:
        """Returns why the external axes ask for the whole file, if they do."""
        if self.away and not (at_rest and self.still):
            return Whole(why="external axes are away from zero")
        return None
