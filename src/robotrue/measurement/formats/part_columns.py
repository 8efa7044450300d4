"""Columns of files about places on a part: names, parts, points and directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import FormatError
from robotrue.measurement.formats.canonical import unknown_column
from robotrue.measurement.formats.sheet import Sheet, column_key, finite_number, read_sheet

POINT: Final = ("px_mm", "py_mm", "pz_mm")
NORMAL: Final = ("nx", "ny", "nz")
UNIT: Final = (0.5, 2.0)
"""Lengths a direction may have; outside it is a coordinate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartSheet:
    """A sheet with the column ``name``, and the place of each of its columns.

    Attributes:
        sheet: As read.
        index: Place of each column by its key.
        names_rows: Messages on a number say which row by its name.
    """

    sheet: Sheet
    index: Mapping[str, int]
    names_rows: bool = True

    def require(
        self,
        needed: Sequence[Sequence[str]],
        optional: Sequence[Sequence[str]],
        hint: str,
        *,
        lacking: Mapping[str, str] | None = None,
    ) -> None:
        """Passes if needed groups of columns are there, and optional ones whole or not at all.

        Args:
            needed: Groups of names.
            optional: Groups of names.
            hint: Of the message on a missing column.
            lacking: What to ask for instead, by the first name of its group.

        Raises:
            FormatError: A column that is in no group, or one that is missing.
        """
        known = [name for group in (*needed, *optional) for name in group]
        for name in self.sheet.header:
            if column_key(name) not in known:
                raise unknown_column(name, known, self.sheet)
        for group in (*needed, *optional):
            missing = [name for name in group if name not in self.index]
            if missing and (group in needed or len(missing) < len(group)):
                wanted = (lacking or {}).get(group[0], ", ".join(missing))
                raise FormatError(
                    f"no column {wanted}; the file has {', '.join(self.sheet.header)}.",
                    source=self.sheet.source,
                    line=self.sheet.header_line,
                    hint=hint,
                )

    def words(self, name: str) -> tuple[str, ...]:
        """Returns a column of text (n,).

        Raises:
            FormatError: A blank cell.
        """
        column = self.index[name]
        for row, line in zip(self.sheet.cells, self.sheet.lines, strict=True):
            if not row[column]:
                raise FormatError(
                    f"column {self.sheet.header[column]!r} is blank, expected a name.",
                    source=self.sheet.source,
                    line=line,
                )
        return tuple(row[column] for row in self.sheet.cells)

    def parts(self) -> tuple[tuple[str, ...], IntArray]:
        """Returns the names of the parts in the order they first appear, and each row's number."""
        if "part" not in self.index:
            return ("part",), np.zeros(len(self.sheet.cells), dtype=np.int64)
        words = self.words("part")
        parts = tuple(dict.fromkeys(words))
        return parts, np.array([parts.index(word) for word in words], dtype=np.int64)

    def numbers(self, names: Sequence[str]) -> Array:
        """Returns columns (n, k), every value finite.

        Raises:
            FormatError: A cell is blank or no finite number.
        """
        rows = [self._row(row, names) for row in range(len(self.sheet.cells))]
        return np.array(rows, dtype=np.float64).reshape(-1, len(names))

    def directions(
        self, names: Sequence[str], what: str, hint: str, *, zero_is_blank: bool
    ) -> Array:
        """Returns directions (n, 3) as printed; NaN in a row that leaves all three blank.

        Args:
            names: The three columns; all rows are NaN where they are not there.
            what: A direction in the message, with ``{}`` for the name of its row.
            hint: Of the message.
            zero_is_blank: Three zeros are no direction either, and no fault.

        Raises:
            FormatError: A direction of a length that no direction has.
        """
        directions = np.full((len(self.sheet.cells), 3), np.nan)
        if names[0] not in self.index:
            return directions
        for row, cells in enumerate(self.sheet.cells):
            if not any(cells[self.index[name]] for name in names):
                continue
            direction = np.array(self._row(row, names))
            length = float(np.linalg.norm(direction))
            if length == 0.0 and zero_is_blank:
                continue
            if not UNIT[0] <= length <= UNIT[1]:
                raise FormatError(
                    f"{what.format(repr(cells[self.index['name']]))} has length {length:g}, "
                    f"expected a direction of length {UNIT[0]:g} to {UNIT[1]:g}.",
                    source=self.sheet.source,
                    line=self.sheet.lines[row],
                    hint=hint,
                )
            directions[row] = direction
        return directions

    def _row(self, row: int, names: Sequence[str]) -> list[float]:
        of = self.sheet.cells[row][self.index["name"]] if self.names_rows else ""
        return [finite_number(self.sheet, row, self.index[name], of=of) for name in names]


def read_part_sheet(path: str | Path, *, names_rows: bool = True) -> PartSheet:
    """Returns the columns of a file.

    Raises:
        FormatError: As :func:`robotrue.measurement.formats.sheet.read_sheet`.
    """
    sheet = read_sheet(path)
    index = {column_key(name): i for i, name in enumerate(sheet.header)}
    return PartSheet(sheet=sheet, index=index, names_rows=names_rows)
