"""Targets that are written out: text put in where a motion names a target it computes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import IntArray


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


NONE_WRITTEN = WrittenOut(
    row=np.zeros(0, np.int64), start=np.zeros(0, np.int64), end=np.zeros(0, np.int64)
)


def put_texts(
    data: bytes, written: WrittenOut, chosen: Sequence[int], texts: Sequence[bytes]
) -> tuple[bytes, IntArray, IntArray]:
    """Returns the bytes with texts put in, and from which old byte on all moved by how much.

    Args:
        data: The file.
        written: Its targets that are written out.
        chosen: Which of them, in file order.
        texts: Their texts.
    """
    parts, at = [], 0
    places, moved = [0], [0]
    for number, text in zip(chosen, texts, strict=True):
        start, end = int(written.start[number]), int(written.end[number])
        parts += [data[at:start], text]
        at = end
        places.append(end)
        moved.append(moved[-1] + len(text) - (end - start))
    parts.append(data[at:])
    return b"".join(parts), np.array(places, np.int64), np.array(moved, np.int64)


def shift_places(start: IntArray, places: IntArray, moved: IntArray) -> IntArray:
    """Returns where bytes (any shape) are after texts were put in; those of -1 stay -1."""
    shift = moved[np.searchsorted(places, np.maximum(start, 0), side="right") - 1]
    return np.asarray(np.where(start < 0, start, start + shift))
