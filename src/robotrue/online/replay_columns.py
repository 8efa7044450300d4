"""Recorded streams read in bulk: tables of numbers, the very same as line by line.

Where a stretch of the file holds nothing but numbers and commas it is read at once; any other, with
blanks, comments or words, is given to the reader of lines.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import FormatError, RobotrueError
from robotrue.online.replay import cells_of, header_names, whole

CHUNK: Final = 1 << 20
"""Bytes read at once."""
_PLAIN: Final = b"0123456789+-.eE,\nnNaA"


def read_columns(
    path: str | Path,
    needed: tuple[str, ...],
    groups: tuple[tuple[str, ...], ...],
    optional: tuple[str, ...],
    *,
    chunk: int = CHUNK,
) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Gives the names of the columns and a table (n, columns) as printed, stretch by stretch.

    Args:
        path: CSV.
        needed: Columns that have to be there.
        groups: Columns that are there together or not at all.
        optional: Columns that may be there.
        chunk: Bytes of a stretch.

    Raises:
        FormatError: As :func:`robotrue.online.replay.replay_joints`, after the rows before it.
        ImplausibleDataError: A sequence that is no whole number.
    """
    found = False
    try:
        with Path(path).open("rb") as stream:
            names, line = _names(stream, path, needed, groups, optional)
            for body in _stretches(stream, chunk):
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
            return header_names(text, path, line, needed, groups, optional), line
    return (), line


def _stretches(stream: BinaryIO, chunk: int) -> Iterator[bytes]:
    """Gives whole lines, many at once; a last line without its end was cut short."""
    rest = b""
    while data := stream.read(chunk):
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
            flat = np.fromstring(_filled(body), dtype=np.float64, sep=",")
    except (DeprecationWarning, ValueError):
        return None
    if len(flat) != len(ends) * columns:
        return None
    table = flat.reshape(-1, columns)
    if "sequence" in names and not _whole(table[:, names.index("sequence")]):
        return None
    return np.asarray(table)


def _filled(body: bytes) -> bytes:
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
    """The rows of a stretch up to the first that is none, and what is wrong with that."""
    rows: list[list[float]] = []
    fault = None
    for number, raw in enumerate(body.split(b"\n")[:-1], start=line + 1):
        try:
            text = _text(raw, path, number)
            if not text:
                continue
            cells = cells_of(text, names, path, number)
            if "sequence" in names:
                whole(cells[names.index("sequence")], path, number)
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
