"""Files of tables as sheets: CSV, TSV, TXT and workbooks, whatever separates their cells."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Final

from robotrue.core.csv_text import as_written
from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import file_provenance, provenance_of_lines
from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet import (
    HEADER_LINES,
    NumberedRow,
    Sheet,
    check_header,
    check_widths,
    is_number,
    join_header_lines,
    read_units,
)

WORKBOOKS: Final = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
BLANKS: Final = " "
"""The delimiter that means "any run of blanks"."""
_COMMENTS: Final = ("#", "//", "%")
"""Marks of a comment line; a semicolon is one, too, where it does not separate numbers."""
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_QUOTED_OR_PLAIN: Final = re.compile(r'"([^"]*)"(?=\s|$)|(\S+)')
_DECIMAL_POINT: Final = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?")


def read_sheet(
    path: str | Path,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
    skip_lines: int = 0,
    header: bool = True,
    header_lines: int = HEADER_LINES,
    worksheet: str | None = None,
) -> Sheet:
    """Returns a CSV, TSV, TXT or workbook file as columns of text.

    Arguments that are ``None`` are detected from the file. Lines that start with ``#``, ``//``,
    ``%`` or ``;`` and lines without any value are skipped; a row of units below the header is not a
    row of numbers.

    Args:
        path: The file; workbooks are recognised by their suffix.
        delimiter: Between cells; ``" "`` is any run of blanks outside quotation marks.
        decimal: ``"."`` or ``","``.
        encoding: Python's name of it.
        skip_lines: Lines before the header.
        header: The first line names the columns; otherwise they are called "1", "2", ...
        header_lines: Lines of the header; their words above each other make one name.
        worksheet: Name of the sheet of a workbook.

    Raises:
        FormatError: Unreadable, cut off, mis-encoded, duplicate names, rows of unequal length.
    """
    data = read_bytes(path)
    if not data.strip():
        raise FormatError("the file is empty.", source=path, hint="export it again.")
    if Path(path).suffix.lower() in WORKBOOKS:
        every = _workbook_rows(path, data, worksheet)[skip_lines:]
        comments = [row[0] for _, row in every if _is_comment(row)]
        rows = [(line, row) for line, row in every if not _is_comment(row)]
    elif data.startswith(b"PK\3\4"):
        raise FormatError(
            "a zip file (a model, or a workbook without its suffix), not a table.",
            source=path,
            hint="give the measurements as CSV, TSV or workbook.",
        )
    else:
        text = _decode(path, data, encoding, skip_lines)
        comments = [line for line in text.splitlines() if line.lstrip().startswith(_COMMENTS)]
        rows = _text_rows(path, text, delimiter, skip_lines)
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        raise FormatError("no rows with values.", source=path, hint="export it again.")
    digest = sha256(data)
    stated = provenance_of_lines(comments)
    sheet = build_sheet(path, rows, digest, header_lines if header else 0, decimal)
    return replace(sheet, provenance=file_provenance(Path(path).name, digest, stated))


def build_sheet(
    path: str | Path,
    rows: list[NumberedRow],
    digest: str,
    header_lines: int,
    decimal: str | None = None,
) -> Sheet:
    """Returns rows of cells as a sheet; without header lines columns are called "1", "2", ...

    Raises:
        FormatError: Duplicate names, rows of unequal length, a header and no rows.
    """
    units: tuple[str, ...] = ()
    if header_lines:
        first, body = join_header_lines(rows[:header_lines]), rows[header_lines:]
        if body and (units := read_units(body[0][1])):
            body = body[1:]
        names = check_header(path, first, body)
    else:
        names, body = tuple(str(i + 1) for i in range(len(rows[0][1]))), rows
    if not body:
        raise FormatError(
            "a header and no rows.", source=path, line=rows[0][0], hint="export it again."
        )
    cells = check_widths(path, names, body)
    return Sheet(
        source=str(path),
        digest=digest,
        header=names,
        cells=cells,
        lines=tuple(line for line, _ in body),
        header_line=first[0] if header_lines else None,
        decimal=decimal or _sniff_decimal(cells),
        provenance=file_provenance(Path(path).name, digest),
        units=units,
    )


def _decode(path: str | Path, data: bytes, encoding: str | None, skip_lines: int) -> str:
    """Returns the text; detects UTF-8 and marked UTF-16, and old code pages in the header only.

    Numbers are ASCII. A degree sign from an old code page in the header is harmless; a byte that
    is no UTF-8 among the numbers means damage, unless the user names the encoding.
    """
    try:
        if encoding is not None:
            return data.decode(encoding)
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return data.decode("utf-16")
        text = data.decode("utf-8-sig")
    except LookupError:
        raise FormatError(
            f"no encoding {encoding!r}.", source=path, hint="'utf-8', 'cp1252' or 'utf-16'."
        ) from None
    except UnicodeError as cause:
        start = getattr(cause, "start", 0)
        line = data.count(b"\n", 0, start) + 1
        if encoding is None and line <= skip_lines + 1:
            head_end = _line_end(data, skip_lines + 1)
            try:
                text = data[:head_end].decode("cp1252") + data[head_end:].decode("utf-8")
                return _without_zeros(path, text)
            except UnicodeDecodeError as later:
                if later.encoding == "utf-8":
                    start = head_end + later.start
                    line = data.count(b"\n", 0, start) + 1
        raise FormatError(
            f"byte 0x{data[start]:02x} is not {encoding or 'UTF-8'}: damage or another encoding.",
            source=path,
            line=line,
            hint='state the encoding in the mapping (encoding = "cp1252"), or export as UTF-8.',
        ) from None
    return _without_zeros(path, text)


def _without_zeros(path: str | Path, text: str) -> str:
    if "\0" in text:
        raise FormatError(
            "holds zero bytes: binary, or UTF-16 without its mark.",
            source=path,
            line=text.count("\n", 0, text.index("\0")) + 1,
            hint='export as UTF-8, or state the encoding in the mapping (encoding = "utf-16").',
        )
    return text


def _line_end(data: bytes, lines: int) -> int:
    end = 0
    for _ in range(lines):
        found = data.find(b"\n", end)
        if found < 0:
            return len(data)
        end = found + 1
    return end


def _text_rows(
    path: str | Path, text: str, delimiter: str | None, skip_lines: int
) -> list[NumberedRow]:
    lines = io.StringIO(text, newline=None).read().split("\n")
    numbered = [
        (i + 1, line)
        for i, line in enumerate(lines)
        if i >= skip_lines and line.strip() and not line.lstrip().startswith(_COMMENTS)
    ]
    plain = [line for _, line in numbered if not line.lstrip().startswith(";")]
    if not plain:
        return []
    mark = delimiter or _sniff_delimiter(plain[0])
    numbered = [(i, line) for i, line in numbered if not _is_remark(line, mark, plain[0])]
    if mark == BLANKS:
        return [(number, _split_at_blanks(line)) for number, line in numbered]
    out = []
    for number, line in numbered:
        try:
            row = next(csv.reader([line], delimiter=mark, strict=True))
        except csv.Error as cause:
            raise FormatError(
                f"cannot be split into columns ({cause}).",
                source=path,
                line=number,
                hint="look for a stray quotation mark.",
            ) from None
        out.append((number, tuple(as_written(cell.strip()) for cell in row)))
    return out


def _split_at_blanks(line: str) -> tuple[str, ...]:
    """Returns the cells; quotation marks hold a name with blanks together."""
    if '"' not in line:
        return tuple(line.split())
    return tuple(quoted or plain for quoted, plain in _QUOTED_OR_PLAIN.findall(line))


def _is_remark(line: str, mark: str, header: str) -> bool:
    """True if a line begins with a semicolon and is neither a row of the table nor its header."""
    if not line.lstrip().startswith(";"):
        return False
    as_long = line.count(mark) == header.count(mark)
    return mark != ";" or not (as_long or any(is_number(cell) for cell in line.split(";")))


def _sniff_delimiter(line: str) -> str:
    for mark in (";", "\t", ",", "|"):
        if mark in line:
            return mark
    return BLANKS


def _sniff_decimal(cells: tuple[tuple[str, ...], ...]) -> str:
    """Returns the mark most numbers have; a date or a version among them does not decide."""
    some = [cell for row in cells[:100] for cell in row]
    commas = sum(1 for cell in some if _DECIMAL_COMMA.fullmatch(cell))
    points = sum(1 for cell in some if _DECIMAL_POINT.fullmatch(cell))
    return "," if commas > points else "."


def _is_comment(row: tuple[str, ...]) -> bool:
    """True if a row of a workbook is the comment line of a text file that was saved as one."""
    return bool(row) and row[0].startswith((*_COMMENTS, ";")) and not any(row[1:])


def _workbook_rows(path: str | Path, data: bytes, worksheet: str | None) -> list[NumberedRow]:
    import python_calamine  # here, so that text files do not pay for it

    try:
        book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        tables = {
            name: book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            for name in book.sheet_names
        }
    except (python_calamine.CalamineError, zipfile.BadZipFile, OSError, ValueError) as cause:
        raise FormatError(
            f"not a workbook, or damaged ({cause}).", source=path, hint="save it again as .xlsx."
        ) from None
    filled = {name: rows for name, rows in tables.items() if rows}
    if worksheet is None and len(filled) == 1:
        worksheet = next(iter(filled))
    if worksheet not in filled:
        wanted = f"no sheet {worksheet!r}" if worksheet else f"{len(filled)} sheets with values"
        raise FormatError(
            f"{wanted}: {', '.join(filled) or 'the workbook is empty'}.",
            source=path,
            hint="name one of them in the mapping (worksheet=...), or save it alone.",
        )
    return [
        (i + 1, tuple(_cell_text(cell) for cell in row)) for i, row in enumerate(filled[worksheet])
    ]


def _cell_text(
    value: str | float | int | bool | date | datetime | time | timedelta | None,
) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    return as_written(str(value).strip())
