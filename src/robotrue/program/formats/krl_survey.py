"""What the surveys of KRL motions and of KRL points share: the scanner, and external axes."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.file_survey import Survey, WindowLines
from robotrue.program.formats.krl_columns import target_numbers
from robotrue.program.formats.krl_scan import Scan, scan
from robotrue.program.program_chunk import Whole


def line_edges(found: Scan) -> tuple[IntArray, IntArray]:
    """Returns the first byte of every line (l,), and the byte after its code (l,)."""
    return found.line_start.astype(np.int64), found.line_end.astype(np.int64)


class KrlSurvey(Survey):
    """One pass over a KRL file."""

    def __init__(self, name: str, targets: int, *, axes_at_rest: bool) -> None:
        super().__init__(name, targets)
        self._axes_at_rest = axes_at_rest
        self._external = ExternalAxes()

    @abstractmethod
    def _sort_scan(self, found: Scan) -> WindowLines | Whole:
        """Returns the lines of a window, or why they cannot be cut."""

    def _sort_lines(self, data: bytes) -> WindowLines | Whole:
        try:
            return self._sort_scan(scan(data, name=self.name))
        except FormatError as cause:
            line = None if cause.line is None else cause.line + self.lines
            raise FormatError(cause.message, source=self.name, line=line, hint=cause.hint) from None

    def _check_end(self) -> Whole | None:
        moves = self._external.away and not (self._axes_at_rest and self._external.steady)
        why = Whole(why="external axes are away from zero") if moves else None
        return super()._check_end() or why


class ExternalAxes:
    """Whether the external axes are away from zero, and the same at all targets so far."""

    def __init__(self) -> None:
        self._first: Array = np.empty((0, 6))
        self.away, self.steady = False, True

    def add(self, found: Scan, plain: BoolArray) -> None:
        """Looks at the targets of plain lines (l,)."""
        aggregates = np.flatnonzero(plain[found.agg_line])
        if not len(aggregates):
            return
        numbers, _, _ = target_numbers(found, aggregates)
        values = numbers.value[:, 8:] if numbers.value.shape[1] > 8 else np.full((1, 6), np.nan)
        self.away |= bool(np.nan_to_num(values).any())
        values = np.where(np.isnan(values), np.inf, values)
        self._first = self._first if len(self._first) else values[:1]
        self.steady &= bool((values == self._first).all())
