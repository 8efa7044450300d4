"""Targets that are written out: text put in where a motion names a target it computes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.number_text import Stretch


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenOut:
    """Targets of a program that stand nowhere as numbers, but have one value.

    Attributes:
        row: (w,) rows of the program, in file order.
        start: (w,) first byte of the text each takes the place of.
        end: (w,) byte after it.
    """

    row: IntArray
    start: IntArray
    end: IntArray

    def part(self, rows: slice, place: int) -> WrittenOut:
        """Returns those of some rows, counted from the first byte of their file."""
        inside = (self.row >= rows.start) & (self.row < rows.stop)
        return WrittenOut(
            row=self.row[inside] - rows.start,
            start=self.start[inside] - place,
            end=self.end[inside] - place,
        )

    def stretches(self, chosen: Sequence[int], texts: Sequence[bytes]) -> list[Stretch]:
        """Returns what puts texts in the places of some of them."""
        return [
            (int(self.start[k]), int(self.end[k] - self.start[k]), text)
            for k, text in zip(chosen, texts, strict=True)
        ]


NONE_WRITTEN = WrittenOut(
    row=np.zeros(0, np.int64), start=np.zeros(0, np.int64), end=np.zeros(0, np.int64)
)
