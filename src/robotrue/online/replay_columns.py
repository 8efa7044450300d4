"""Recorded streams as tables of numbers: CSV in stretches of whole lines, TDMS through npTDMS.

Joints: ``t_s,a1_deg..a6_deg``, with ``x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg`` of the tool point if
recorded. Force: ``t_s,fx_N,fy_N,fz_N``, with ``tx_Nm,ty_Nm,tz_Nm`` and ``status`` if recorded.
Both may have ``host_s`` and ``sequence``. A cell that is empty or ``nan`` is a value that was not
valid: its sample is marked, not dropped.

A stretch that holds nothing but numbers and commas is read at once; any other, with blanks,
comments or words, line by line.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import FormatError, ImplausibleDataError, RobotrueError

TIME: Final = ("t_s",)
CLOCKS: Final = ("host_s", "sequence")
JOINTS: Final = tuple(f"a{i}_deg" for i in range(1, 7))
POSE: Final = ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")
FORCE: Final = ("fx_N", "fy_N", "fz_N")
TORQUE: Final = ("tx_Nm", "ty_Nm", "tz_Nm")
CHUNK: Final = 1 << 20
"""Bytes read at once."""
_TDMS_ROWS: Final = 1 << 14
_PLAIN: Final = b"0123456789+-.eE,\nnNaA"


def read_columns(
    path: str | Path,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Gives the names of the columns and a table (n, columns) as printed, stretch by stretch.

    Args:
        path: CSV.
        needed: Columns that have to be there.
        groups: Columns that are there together or not at all.
        optional: Columns that may be there.

    Raises:
        FormatError: Unreadable, a column missing, unknown or without unit, a cell that is no
            number, with its line and after the rows before it. A last line without its end was
            cut short and is left out.
        ImplausibleDataError: A sequence that is no whole number.
    """
    found = False
    try:
        with Path(path).open("rb") as stream:
            names, line = _names(stream, path, needed, groups, optional)
            for body in _stretches(stream):
                table = _at_once(body, names) if names else None
                fault = None
                if table is None and names:
                    table, fault = _by_line(body, names, path, line)
                line += body.count(b"\n")
                if table is not None and len(table):
                    found = True
                    yield names, table
                if fault is not None:
                    raise fault
    except OSError as cause:
        raise FormatError(
            f"cannot read: {cause.strerror}.", source=path, hint="check the path."
        ) from cause
    if not found:
        raise FormatError("no rows.", source=path, hint="was the recording ever started?")


def read_tdms_table(path: str | Path) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Gives the forces of a TDMS record as :func:`read_columns`; it is read whole.

    Raises:
        FormatError: Unreadable.
        ImplausibleDataError: A record that no sensor can have made.
        MissingExtraError: Without npTDMS.
    """
    from robotrue.dynamics.formats.signal_table import read_force

    record, _ = read_force(path)
    for first in range(0, len(record), _TDMS_ROWS):
        part = slice(first, first + _TDMS_ROWS)
        yield (*TIME, *FORCE), np.column_stack([record.time[part], record.force[part]])


def _names(
    stream: BinaryIO,
    path: str | Path,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
) -> tuple[tuple[str, ...], int]:
    """Names of the columns and the number of their line; none in a file that has none."""
    line = 0
    while (raw := stream.readline()).endswith(b"\n"):
        line += 1
        text = _text(raw, path, line)
        if text:
            return _column_names(text, path, line, needed, groups, optional), line
    return (), line


def _stretches(stream: BinaryIO) -> Iterator[bytes]:
    """Gives whole lines, many at once; a last line without its end was cut short."""
    rest = b""
    while data := stream.read(CHUNK):
        data = rest + data
        cut = data.rfind(b"\n") + 1
        body, rest = data[:cut], data[cut:]
        if body:
            yield body


def _at_once(body: bytes, names: tuple[str, ...]) -> Array | None:
    """The table of a stretch of nothing but numbers; None if it may be anything else."""
    columns = len(names)
    if b"\r" in body:
        body = body.replace(b"\r\n", b"\n")
    if body.translate(None, _PLAIN):
        return None
    code = np.frombuffer(body, dtype=np.uint8)
    ends = np.flatnonzero(code == ord("\n"))
    commas = np.searchsorted(np.flatnonzero(code == ord(",")), ends)
    if (np.diff(commas, prepend=0) != columns - 1).any():
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what cannot be read to its end is only warned of
            flat = np.fromstring(_fill_empty_cells(body), dtype=np.float64, sep=",")
    except (DeprecationWarning, ValueError):
        return None
    if len(flat) != len(ends) * columns:
        return None
    table = flat.reshape(-1, columns)
    if "sequence" in names and not _whole(table[:, names.index("sequence")]):
        return None
    return np.asarray(table)


def _fill_empty_cells(body: bytes) -> bytes:
    """The cells one after the other, the empty ones as nan."""
    body = body[:-1].replace(b"\n", b",")
    if body.startswith(b","):
        body = b"nan" + body
    if body.endswith(b","):
        body += b"nan"
    for _ in range(2):  # of three commas in a row the second pair is seen the second time
        body = body.replace(b",,", b",nan,")
    return body


def _whole(values: Array) -> bool:
    return bool(((values >= 0.0) & (values < 2.0**53) & (values == np.floor(values))).all())


def _by_line(
    body: bytes, names: tuple[str, ...], path: str | Path, line: int
) -> tuple[Array, RobotrueError | None]:
    """Returns the rows of a stretch up to the first invalid one, and its fault."""
    rows: list[list[float]] = []
    fault = None
    for number, raw in enumerate(body.split(b"\n")[:-1], start=line + 1):
        try:
            text = _text(raw, path, number)
            if not text:
                continue
            cells = _line_numbers(text, names, path, number)
            if "sequence" in names and not _whole(np.array(cells[names.index("sequence")])):
                raise ImplausibleDataError(
                    f"sequence {cells[names.index('sequence')]:g}, expected a whole number from 0.",
                    source=path,
                    line=number,
                )
        except RobotrueError as cause:
            fault = cause
            break
        rows.append(cells)
    return np.array(rows, dtype=np.float64).reshape(-1, len(names)), fault


def _text(raw: bytes, path: str | Path, line: int) -> str:
    """A line without its blanks; empty if it is a comment."""
    try:
        text = raw.decode("utf-8-sig" if line == 1 else "utf-8").strip()
    except UnicodeDecodeError as cause:
        raise FormatError("not text in UTF-8.", source=path, line=line) from cause
    return "" if text.startswith("#") else text


def _column_names(
    text: str,
    path: str | Path,
    line: int,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
) -> tuple[str, ...]:
    """Returns the names of the columns.

    Args:
        text: The line.
        path: Of the message.
        line: Of the message.
        needed: Columns that have to be there.
        groups: Columns that are there together or not at all.
        optional: Columns that may be there.

    Raises:
        FormatError: A column missing, not known or twice.
    """
    names = tuple(name.strip() for name in text.split(","))
    known = {*needed, *optional, *(name for group in groups for name in group)}
    unknown = [name for name in names if name not in known]
    missing = [name for name in needed if name not in names]
    for group in groups:
        if any(name in names for name in group):
            missing += [name for name in group if name not in names]
    if unknown or missing or len(set(names)) != len(names):
        raise FormatError(
            f"columns {','.join(names)}: "
            + (f"missing {', '.join(missing)}." if missing else "")
            + (f"not known {', '.join(unknown)}." if unknown else "")
            + ("" if missing or unknown else "one occurs twice."),
            source=path,
            line=line,
            hint=f"{','.join(needed)} and, where recorded, {','.join(sorted(known - {*needed}))}.",
        )
    return names


def _line_numbers(text: str, names: tuple[str, ...], path: str | Path, line: int) -> list[float]:
    """Returns the numbers of a line, NaN for an empty cell.

    Raises:
        FormatError: Another number of cells, or one that is no number.
    """
    cells = text.split(",")
    if len(cells) != len(names):
        raise FormatError(
            f"{len(cells)} cells, expected {len(names)}.",
            source=path,
            line=line,
            hint="a decimal comma?",
        )
    try:
        return [float(cell) if cell.strip() else math.nan for cell in cells]
    except ValueError as cause:
        raise FormatError(f"no number: {cause}.", source=path, line=line) from cause
