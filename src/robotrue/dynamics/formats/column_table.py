"""Long tables of numbers with named columns: fast where they are sound, exact about where not."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import as_written, csv_text
from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import Provenance, read_provenance
from robotrue.core.utf8 import utf8_text
from robotrue.errors import FormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnTable:
    """Named columns of finite numbers.

    Attributes:
        source: Path as given.
        digest: SHA-256 of the file.
        names: As written, stripped.
        values: (n, k) in the units of the names.
        first_line: Line of the first row; the rows follow without a gap.
        header_line: Line of the names.
        provenance: The file, and whether a comment line in it says that it was simulated.
    """

    source: str
    digest: str
    names: tuple[str, ...]
    values: Array
    first_line: int
    header_line: int
    provenance: Provenance

    def column(self, name: str) -> Array:
        """Returns (n,) of a column that is there."""
        return np.asarray(self.values[:, self.names.index(name)])

    def line(self, row: int) -> int:
        """Returns the line of a row counted from 0."""
        return self.first_line + row

    def stack(self, names: Sequence[str]) -> Array:
        """Returns (n, k) of columns that are there."""
        return np.column_stack([self.column(name) for name in names])

    def fault(self, message: str, hint: str) -> FormatError:
        """Returns the error of the header, with its line."""
        return FormatError(message, source=self.source, line=self.header_line, hint=hint)


def read_column_table(path: str | Path) -> ColumnTable:
    """Returns a CSV file of numbers; comma, semicolon or tab, ``#`` lines before the header.

    Raises:
        FormatError: Unreadable, no header, a name twice, a cell that is blank, no number or not
            finite, rows of unequal length; with its line.
    """
    import pandas as pd

    data = read_bytes(path)
    text = _text(data, path)
    head, header, start = _header(text)
    if head == 0:
        raise FormatError("the file is empty.", source=path, hint="export it again.")
    mark = next((m for m in (";", "\t", ",") if m in header), ",")
    names = _names(header.split(mark), path, head)
    body = text[start:].rstrip()
    if not body:
        raise FormatError("a header and no rows.", source=path, line=head, hint="export it again.")
    first = body[: body.find("\n")] if "\n" in body else body
    decimal = "," if mark != "," and "," in first else "."
    try:
        values = pd.read_csv(
            io.StringIO(body),
            sep=mark,
            header=None,
            names=list(range(len(names))),
            index_col=False,
            dtype=np.float64,
            decimal=decimal,
            skip_blank_lines=False,
            on_bad_lines="error",
        ).to_numpy()
    except (ValueError, pd.errors.ParserError, pd.errors.ParserWarning):
        values = np.empty((0, 0))
    rows = body.count("\n") + 1
    if values.shape != (rows, len(names)) or not np.isfinite(values).all():
        raise _fault(body.split("\n"), names, mark, decimal, path, head + 1)
    return ColumnTable(
        source=str(path),
        digest=sha256(data),
        names=names,
        values=values,
        first_line=head + 1,
        header_line=head,
        provenance=read_provenance(path),
    )


def table_bytes(names: list[str], values: Array) -> bytes:
    """Returns a CSV of named columns; NaN becomes a blank cell."""
    rows = np.char.mod("%.9g", values)
    rows[~np.isfinite(values)] = ""
    lines = (",".join(row) + "\n" for row in rows.tolist())
    return "".join([csv_text([names]), *lines]).encode()


def _text(data: bytes, path: str | Path) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    text = utf8_text(data, path, hint="export as CSV in UTF-8; this is binary, or damaged.")
    if "\0" in text:
        raise FormatError("holds zero bytes: a binary file.", source=path, hint="export as CSV.")
    return text


def _header(text: str) -> tuple[int, str, int]:
    """Line of the header from 1 (0: none), the header, and where the rows begin in the text."""
    start, line = 0, 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line += 1
        found = text[start:end].strip()
        start = end + 1
        if found and not found.startswith("#"):
            return line, found, start
    return 0, "", start


def _names(cells: list[str], path: str | Path, line: int) -> tuple[str, ...]:
    names = tuple(as_written(cell.strip().strip('"')) for cell in cells)
    try:
        [float(name) for name in names]
    except ValueError:
        pass
    else:
        raise FormatError(
            f"the first line holds numbers ({names[0]}, ...), expected column names with units.",
            source=path,
            line=line,
            hint="add a header line.",
        )
    for i, name in enumerate(names):
        if not name or name in names[:i]:
            raise FormatError(
                f"column {i + 1} is called {name!r}: "
                + ("without a name." if not name else "a name that was there before."),
                source=path,
                line=line,
            )
    return names


def _fault(
    body: list[str], names: tuple[str, ...], mark: str, decimal: str, path: str | Path, first: int
) -> FormatError:
    """Finds the first cell that is wrong; slow, and only on the way out."""
    for number, line in zip(itertools.count(first), body, strict=False):
        cells = line.split(mark)
        if len(cells) != len(names):
            last = number == first + len(body) - 1
            return FormatError(
                f"{len(cells)} cells, expected {len(names)}"
                + (": the file ends in the middle of its last line." if last else "."),
                source=path,
                line=number,
                hint="export the file again." if last else "look for a missing delimiter.",
            )
        for name, cell in zip(names, cells, strict=True):
            plain = cell.strip().replace(",", ".") if decimal == "," else cell.strip()
            try:
                value = float(plain)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                return FormatError(
                    f"{name} is {plain or 'blank'}, expected a finite number.",
                    source=path,
                    line=number,
                    hint="correct that cell, or cut the record off before it.",
                )
    return FormatError("cannot be read as a table of numbers.", source=path, line=first)
