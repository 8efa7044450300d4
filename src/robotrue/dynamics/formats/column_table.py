"""Long tables of numbers with named columns: fast where they are sound, exact about where not.

Columns of a CSV file, variables of a MAT file, channels of a TDMS file (through npTDMS, extra
``dynamics``), and whether their times are an even clock.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeVar

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import read_bytes, sha256, utf8_text
from robotrue.core.provenance import Provenance, read_provenance
from robotrue.dynamics.frf import ComplexArray
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError
from robotrue.measurement.formats.sheet_file import read_sheet

Samples = TypeVar("Samples", Array, ComplexArray)
_ODD: Final = re.compile(r"[\"'\0]|\A[-+.\d]")
"""In a header of names that are quoted, or of numbers."""
_OFF: Final = 0.25
"""Part of a sample by which a printed time may be off an even clock (rounding of its digits)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnTable:
    """Named columns of finite numbers.

    Attributes:
        source: Path as given.
        digest: SHA-256 of the file.
        names: As written, stripped.
        values: (n, k) in the units of the names.
        lines: (n,) line of each row.
        header_line: Line of the names.
        provenance: The file, and whether a comment line in it states that it was simulated.
    """

    source: str
    digest: str
    names: tuple[str, ...]
    values: Array
    lines: Sequence[int]
    header_line: int
    provenance: Provenance

    def column(self, name: str) -> Array:
        """Returns a required column, (n,)."""
        return np.asarray(self.values[:, self.names.index(name)])

    def line(self, row: int) -> int:
        """Returns the line of a row counted from 0."""
        return self.lines[row]

    def stack(self, names: Sequence[str]) -> Array:
        """Returns required columns, (n, k)."""
        return np.column_stack([self.column(name) for name in names])

    def fault(self, message: str, hint: str) -> FormatError:
        """Returns the error of the header, with its line."""
        return FormatError(message, source=self.source, line=self.header_line, hint=hint)

    def require(self, needed: Sequence[str], optional: Sequence[str] = (), hint: str = "") -> None:
        """Checks that all needed columns exist, and no others but the optional ones.

        Raises:
            FormatError: A column that is missing, with the hint, or not known.
        """
        missing = [f"no column {name}" for name in needed if name not in self.names]
        known = {*needed, *optional}
        unknown = [f"column {name!r} is not known" for name in self.names if name not in known]
        if missing or unknown:
            raise self.fault(
                f"{', '.join(missing[:1] + unknown[:1])}; expected "
                f"{','.join((*needed, *optional))}.",
                hint if missing else "remove the column.",
            )


def read_column_table(path: str | Path) -> ColumnTable:
    """Returns a CSV file of numbers; comma, semicolon or tab, ``#`` lines are remarks.

    A file of nothing but a header and numbers is read at once, any other as a sheet, cell by cell,
    which knows what is wrong with it.

    Raises:
        FormatError: Unreadable, no header, a name twice, a cell that is blank, no number or not
            finite, rows of unequal length; with its line.
    """
    data = read_bytes(path)
    head, names, values = _read_plain(_decode(data, path))
    if values is None or not np.isfinite(values).all():
        sheet = read_sheet(path)
        return ColumnTable(
            source=sheet.source,
            digest=sheet.digest,
            names=sheet.header,
            values=sheet.numbers(sheet.header),
            lines=sheet.lines,
            header_line=sheet.header_line or 1,
            provenance=sheet.provenance,
        )
    return ColumnTable(
        source=str(path),
        digest=sha256(data),
        names=names,
        values=values,
        lines=range(head + 1, head + 1 + len(values)),
        header_line=head,
        provenance=read_provenance(path),
    )


def check_suffix(path: str | Path, known: Sequence[str]) -> str:
    """Returns the suffix of a file in lower case.

    Raises:
        FormatError: It is not a known one.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        raise FormatError(
            f"suffix {Path(path).suffix!r} is not known.",
            source=path,
            hint=f"one of {', '.join(known)}.",
        )
    return suffix


def table_bytes(names: list[str], values: Array) -> bytes:
    """Returns a CSV of named columns; NaN becomes a blank cell."""
    rows = np.char.mod("%.9g", values)
    rows[~np.isfinite(values)] = ""
    lines = (",".join(row) + "\n" for row in rows.tolist())
    return "".join([csv_text([names]), *lines]).encode()


def read_mat(path: str | Path) -> dict[str, ComplexArray]:
    """Returns the variables of a MAT file (to version 7.2) by name.

    Raises:
        FormatError: Unreadable.
    """
    from scipy.io import loadmat  # here, so that text files do not pay for it

    data = read_bytes(path)
    if data[:8] == b"\x89HDF\r\n\x1a\n" or data.startswith(b"MATLAB 7.3"):
        raise FormatError(
            "a MAT file of version 7.3 (HDF5).", source=path, hint="save it with -v7."
        )
    try:
        variables = loadmat(io.BytesIO(data))  # type: ignore[arg-type]  # files work, too
    except Exception as cause:  # SciPy raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as a MAT file ({cause}).", source=path, hint="save it with -v7."
        ) from cause
    return {name: np.asarray(v) for name, v in variables.items() if not name.startswith("__")}


def mat_column(
    variables: Mapping[str, ComplexArray], name: str, path: str | Path, length: int | None = None
) -> Array:
    """Returns a variable of :func:`read_mat` as a real column.

    Raises:
        FormatError: It is missing, of another length, or holds what is no number.
    """
    if name not in variables:
        raise FormatError(
            f"no variable {name}; the file has {', '.join(variables) or 'none'}.",
            source=path,
            hint="names carry their units, as in the CSV.",
        )
    column = finite_samples(np.ravel(variables[name]), name, path, length)
    return np.asarray(column.real, dtype=np.float64)


def finite_samples(
    values: Samples, name: str, path: str | Path, length: int | None = None
) -> Samples:
    """Returns samples (n,) that are numbers.

    Raises:
        FormatError: Another length than stated, or a sample that is no finite number.
    """
    if length is not None and len(values) != length:
        raise FormatError(f"{name} has {len(values)} values, expected {length}.", source=path)
    if values.dtype.kind not in "fiuc" or not np.isfinite(values).all():
        bad = int(np.argmin(np.isfinite(values))) if values.dtype.kind in "fc" else 0
        raise FormatError(
            f"sample {bad} of {name} is {values[bad]}, expected a finite number.",
            source=path,
            hint="cut the record before it.",
        )
    return values


def even_rate(
    time: Array, source: str | Path, line_of: Callable[[int], int] | None = None
) -> tuple[float, float]:
    """Returns the first time (s) and the rate (samples/s) of evenly spaced times (n,) s.

    Args:
        time: As read.
        source: Of the message.
        line_of: Row to line of the file, for the message.

    Raises:
        ImplausibleDataError: Fewer than two samples, a time that does not rise, missing samples
            or an uneven clock.
    """

    def refuse(row: int, what: str, hint: str) -> ImplausibleDataError:
        place = None if line_of is None else line_of(row)
        named = what if line_of is not None else f"sample {row}: {what}"
        return ImplausibleDataError(named, source=source, line=place, hint=hint)

    if len(time) < 2:
        raise refuse(0, f"{len(time)} sample, expected two or more.", "record for longer.")
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        raise refuse(
            row,
            f"time goes from {time[row - 1]:.9g} to {time[row]:.9g} s: duplicated or reordered "
            "samples.",
            "sort them out at the recorder; a record is not repaired here.",
        )
    usual = float(np.median(step))
    if step.max() > 1.6 * usual:
        row = int(np.argmax(step > 1.6 * usual)) + 1
        missing = round(step[row - 1] / usual) - 1
        raise refuse(
            row,
            f"time jumps by {step[row - 1]:.6g} s where samples are {usual:.6g} s apart: about "
            f"{max(missing, 1)} missing.",
            "cut the record there, and predict each piece.",
        )
    index = np.arange(len(time))
    period = (time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - index * period)
    if off.max() > _OFF * period * max(1.0, 1e-4 * len(time)) or step.min() < 0.4 * usual:
        row = int(np.argmax(off))
        raise refuse(
            row,
            f"an uneven clock: {off[row]:.3g} s off samples of {period:.6g} s.",
            "record with a hardware clock, or resample at the recorder.",
        )
    return float(time[0]), float(1.0 / period)


def _decode(data: bytes, path: str | Path) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    return utf8_text(data, path, hint="export as CSV in UTF-8; this is binary, or damaged.")


def _read_plain(text: str) -> tuple[int, tuple[str, ...], Array | None]:
    """Line of the header, names and numbers (n, k) of a file that holds nothing else, or None."""
    import pandas as pd

    head, header, start = _header(text)
    mark = next((m for m in (";", "\t", ",") if m in header), ",")
    names = tuple(name.strip() for name in header.split(mark))
    body = text[start:].rstrip()
    if not body or "" in names or len(set(names)) < len(names) or _ODD.search(header):
        return head, names, None
    first = body[: body.find("\n")] if "\n" in body else body
    try:
        values = pd.read_csv(
            io.StringIO(body),
            sep=mark,
            header=None,
            names=list(range(len(names))),
            index_col=False,
            dtype=np.float64,
            decimal="," if mark != "," and "," in first else ".",
            skip_blank_lines=False,
            on_bad_lines="error",
        ).to_numpy()
    except (ValueError, pd.errors.ParserError, pd.errors.ParserWarning):
        return head, names, None
    rows = body.count("\n") + 1
    return head, names, values if values.shape == (rows, len(names)) else None


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


class TdmsChannel(Protocol):
    """A channel of npTDMS, which has no types."""

    name: str
    path: str
    properties: Mapping[str, float | str]

    def __getitem__(self, rows: slice) -> Array: ...


def read_tdms_groups(path: str | Path) -> list[Sequence[TdmsChannel]]:
    """Returns the channels of a file, group by group.

    Raises:
        FormatError: It cannot be read.
        MissingExtraError: Without npTDMS.
    """
    try:
        import nptdms
    except ImportError as cause:
        raise MissingExtraError(
            "TDMS needs npTDMS.", hint="pip install 'robotrue[dynamics]'"
        ) from cause
    try:
        file = nptdms.TdmsFile.read(io.BytesIO(read_bytes(path)))
    except FormatError:
        raise
    except Exception as cause:  # npTDMS raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as TDMS ({type(cause).__name__}: {cause}).", source=path
        ) from cause
    return [group.channels() for group in file.groups()]
