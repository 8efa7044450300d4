"""A file as named columns of text cells with line numbers, independent of robots.

Checks common to all tables: required columns, their numbers, their words, and the message with the
line of each fault. Header lines, a row of units and rows as long as the header are read here, too.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, zip_longest
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line
from robotrue.errors import FormatError

HEADER_LINES: Final = 1
"""Default number of header lines."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Column names and rows of text.

    Attributes:
        source: Path as the user gave it.
        digest: SHA-256 of the file's bytes.
        header: Column names, stripped, as written.
        cells: One tuple per row, as long as ``header``, stripped.
        lines: One-based line (or workbook row) of each row.
        header_line: That of the header; None without one.
        decimal: Decimal mark of the numbers, ``"."`` or ``","``.
        provenance: The file, and whether a comment line in it states that it was simulated.
        units: Of the columns, as a row below the header states them; empty without such a row.
        monuments: Rows of nests on the floor, which hold no pose; None where none were named.
        remarks: Remarks on how the rows were read, one sentence each.
    """

    source: str
    digest: str
    header: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    header_line: int | None
    decimal: str
    provenance: Provenance
    units: tuple[str, ...] = ()
    monuments: Sheet | None = None
    remarks: tuple[str, ...] = ()
    _index: Mapping[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Finds each column by its key."""
        index = {column_key(name): i for i, name in enumerate(self.header)}
        object.__setattr__(self, "_index", index)

    def __len__(self) -> int:
        return len(self.cells)

    def has(self, name: str) -> bool:
        """Returns whether there is a column of that name."""
        return column_key(name) in self._index

    def take(self, rows: Iterable[int]) -> Sheet:
        """Returns the sheet of some rows, in their order."""
        chosen = list(rows)
        cells = tuple(self.cells[i] for i in chosen)
        return replace(self, cells=cells, lines=tuple(self.lines[i] for i in chosen))

    def column(self, name: str) -> tuple[str, ...]:
        """Returns the cells (n,) of an existing column."""
        index = self._index[column_key(name)]
        return tuple(row[index] for row in self.cells)

    def words(self, name: str) -> tuple[str, ...]:
        """Returns a column of text (n,).

        Raises:
            FormatError: A blank cell.
        """
        words = self.column(name)
        if "" in words:
            header = self.header[self._index[column_key(name)]]
            message = f"column {header!r} is blank, expected a name."
            raise self.fault(message, "correct or delete that row.", row=words.index(""))
        return words

    def parse(self, name: str) -> Array:
        """Returns a column (n,) as numbers with the sheet's decimal mark; NaN where a cell is none.

        The other mark is refused: it is a separator of thousands, or of another number.
        """
        cells = self.column(name)
        other = "." if self.decimal == "," else ","
        plain = [cell.replace(",", ".") for cell in cells] if self.decimal == "," else cells
        try:
            values = np.array([float(cell) for cell in plain])
        except ValueError:
            values = np.array([_to_number(cell) for cell in plain])
        values[[other in cell or "_" in cell for cell in cells]] = np.nan
        return values

    def numbers(self, names: Sequence[str], *, named_by: str = "") -> Array:
        """Returns columns (n, k) in the file's units, every value finite.

        Args:
            names: Of the columns.
            named_by: Column that identifies a row in messages.

        Raises:
            FormatError: A column that is missing, a cell that is blank or no finite number.
        """
        missing = [name for name in names if not self.has(name)]
        if missing:
            raise self.lacking_columns(missing, "state which columns hold them, or name them so.")
        values = np.stack([self.parse(name) for name in names], axis=1)
        for row, k in np.argwhere(~np.isfinite(values)).tolist():
            index = self._index[column_key(names[k])]
            of = f" of {self.column(named_by)[row]!r}" if named_by else ""
            text = self.cells[row][index] or "blank"
            message = f"{self.header[index]}{of} is {text}, expected a finite number."
            raise self.fault(message, "correct or delete that row.", row=row)
        return values

    def check_columns(
        self,
        needed: Sequence[Sequence[str]],
        optional: Sequence[Sequence[str]],
        hint: str,
        *,
        lacking: Mapping[str, str] | None = None,
    ) -> None:
        """Checks that needed groups of columns exist, and optional ones whole or not at all.

        Args:
            needed: Groups of names.
            optional: Groups of names.
            hint: Of the message on a missing column.
            lacking: Alternative columns, by the first name of their group.

        Raises:
            FormatError: A column that is in no group, or one that is missing.
        """
        self.refuse_others([name for group in (*needed, *optional) for name in group])
        for group in (*needed, *optional):
            missing = [name for name in group if not self.has(name)]
            if missing and (group in needed or len(missing) < len(group)):
                wanted = (lacking or {}).get(group[0], ", ".join(missing))
                listed = ", ".join(self.header)
                raise self.fault(f"no column {wanted}; the file has {listed}.", hint)

    def refuse_others(self, known: Sequence[str]) -> None:
        """Passes if there is no column but the known ones.

        Raises:
            FormatError: There is; proposes the nearest known name.
        """
        keys = {column_key(name): name for name in known}
        for name in self.header:
            if column_key(name) not in keys:
                near = difflib.get_close_matches(column_key(name), keys, n=1, cutoff=0.6)
                raise self.fault(
                    f"unknown column {name!r}; allowed are {', '.join(known)}.",
                    f"rename it to {keys[near[0]]!r}, or remove it."
                    if near
                    else "remove the column.",
                )

    def lacking_columns(self, names: Sequence[str], hint: str) -> FormatError:
        """Returns the error for columns that are missing."""
        missing = ", ".join(map(repr, names))
        return self.fault(f"no column {missing}; the file has {', '.join(self.header)}.", hint)

    def fault(self, message: str, hint: str, *, row: int | None = None) -> FormatError:
        """Returns the error for a row, with its line; for the header without one."""
        line = self.header_line if row is None else self.lines[row]
        return FormatError(message, source=self.source, line=line, hint=hint)


def column_key(name: str) -> str:
    """Returns the form in which column names are compared: no outer blanks, no case."""
    return " ".join(name.split()).casefold()


def number_columns(
    names: Sequence[str], values: Array, written: Callable[[float], str] = repr
) -> dict[str, list[str]]:
    """Returns columns (n, k) as text by their names; NaN is blank.

    Args:
        names: Of the columns.
        values: (n, k).
        written: Text of a number; all its digits if not given.
    """
    return {
        name: ["" if np.isnan(v) else written(float(v)) for v in values[:, i]]
        for i, name in enumerate(names)
    }


def write_six_digits(value: float) -> str:
    """Returns a number with at most six decimals."""
    return f"{value:.6f}".rstrip("0").rstrip(".") if value else "0"


def write_columns(
    path: str | Path, columns: Mapping[str, Sequence[str]], provenance: Provenance
) -> None:
    """Writes columns of text as CSV, whole or not at all; simulated ones under a comment line.

    Raises:
        FormatError: The file cannot be written.
    """
    rows = zip(*columns.values(), strict=True)
    text = mark_line(provenance) + csv_text(chain([columns], rows))
    write_atomic(path, text.encode())


def _to_number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


NumberedRow: TypeAlias = tuple[int, tuple[str, ...]]
"""One-based line and its cells."""
_UNITS: Final = frozenset(
    "mm m um µm in inch deg degree degrees ° rad mrad s ms sec n nm kg c °c k mm^2 mm² - --".split()
)
"""Words of a row of units, in lower case."""


def is_number(cell: str) -> bool:
    """Returns whether a cell is a number, with either decimal mark."""
    return bool(re.fullmatch(r"[+-]?(?:\d++(?:[.,]\d++)?|[.,]\d++)(?:[eE][+-]?\d+)?", cell))


def join_header_lines(rows: list[NumberedRow]) -> NumberedRow:
    """Returns one header of several lines: the words above each other, with a blank between.

    A blank cell of an upper line continues the word to its left, as merged cells of a workbook do.
    """
    upper = [_fill_right(cells) for _, cells in rows[:-1]]
    stacks = zip_longest(*upper, rows[-1][1], fillvalue="")
    return rows[-1][0], tuple(" ".join(word for word in stack if word) for stack in stacks)


def _fill_right(cells: tuple[str, ...]) -> tuple[str, ...]:
    filled: list[str] = []
    for cell in cells:
        filled.append(cell or (filled[-1] if filled else ""))
    return tuple(filled)


def read_units(row: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the units that a row below the header states, in lower case; empty: no such row."""
    words = tuple(cell.strip("[]() ").lower() for cell in row)
    known = all(word in _UNITS for word in words if word)
    return words if known and any(word.strip("-") for word in words) else ()


def check_header(path: str | Path, header: NumberedRow, body: list[NumberedRow]) -> tuple[str, ...]:
    """Returns the column names of a header.

    Raises:
        FormatError: Numbers in place of names, a column without a name or two of one name.
    """
    line, row = header
    # An instrument that ends every line with a delimiter makes a last column without a name.
    if row[-1] == "" and not any(
        len(cells) >= len(row) and cells[len(row) - 1] for _, cells in body
    ):
        row = row[:-1]
    if all(is_number(cell) for cell in row):
        raise FormatError(
            f"the first line holds numbers ({row[0]}, ...), expected column names.",
            source=path,
            line=line,
            hint="add a header line, or use a mapping with header=False.",
        )
    seen: dict[str, int] = {}
    for i, name in enumerate(row):
        if not name:
            raise FormatError(f"column {i + 1} has no name.", source=path, line=line)
        if column_key(name) in seen:
            raise FormatError(
                f"column {name!r} appears twice: columns {seen[column_key(name)]} and {i + 1}.",
                source=path,
                line=line,
                hint="rename or remove one of them.",
            )
        seen[column_key(name)] = i + 1
    return row


def check_widths(
    path: str | Path, names: tuple[str, ...], body: list[NumberedRow]
) -> tuple[tuple[str, ...], ...]:
    """Returns rows that are as long as the header; blank cells beyond it are cut.

    Raises:
        FormatError: A row that is not.
    """
    width = len(names)
    rectangle = []
    for line, row in body:
        if len(row) > width and not any(row[width:]):
            row = row[:width]
        if len(row) != width:
            last = line == body[-1][0] and len(row) < width
            raise FormatError(
                f"{len(row)} columns, expected {width}"
                + (": the file ends in the middle of its last line." if last else "."),
                source=path,
                line=line,
                hint="copy or export the file again." if last else "look for a missing delimiter.",
            )
        rectangle.append(row)
    return tuple(rectangle)
