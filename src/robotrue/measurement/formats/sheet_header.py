"""Header lines and the row of units of a table, and rows as long as its header."""

from __future__ import annotations

import re
from itertools import zip_longest
from pathlib import Path
from typing import Final, TypeAlias

from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet import column_key

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
