"""What the surveys of KRL motions and of KRL points share: the scanner, and external axes."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray, Ints
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.errors import FormatError
from robotrue.program.formats.file_survey import Survey, WindowLines
from robotrue.program.formats.krl_scan import EXTERNAL, STATUS, Scan, scan
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
        self._first = np.full(6, np.nan)
        self.away, self.steady = False, True

    def add(self, found: Scan, plain: BoolArray) -> None:
        """Looks at the targets of plain lines (l,)."""
        away, steady = _external_axes(
            found.agg_line, found.agg_token, found.tok_component, found.tok_value, plain,
            self._first,
        )  # fmt: skip
        self.away |= away
        self.steady &= steady


@compile_kernel(PLAIN)
def _external_axes(
    agg_line: Ints, agg_token: Ints, component: Bytes, value: Array, plain: BoolArray, first: Array
) -> tuple[bool, bool]:
    """Returns whether external axes of plain lines are away from zero, and stand still.

    ``first`` (6,) are the values of the first target of the file, infinite where it has none; NaN
    before it, and written then.
    """
    here = np.empty(6)
    away, steady = False, True
    for agg in range(agg_line.size):
        if not plain[agg_line[agg]]:
            continue
        here[:] = np.inf
        for t in range(agg_token[agg], agg_token[agg + 1]):
            if EXTERNAL <= component[t] < STATUS:
                here[component[t] - EXTERNAL] = value[t]
                away |= value[t] != 0.0
        for k in range(6):
            if np.isnan(first[k]):
                first[k] = here[k]
            steady &= first[k] == here[k]
    return away, steady
