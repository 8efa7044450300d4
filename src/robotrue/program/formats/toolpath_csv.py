"""Tool paths as CSV: ``x_mm,y_mm,z_mm`` and, as needed, axis, feed, rapid flag and operation.

``i,j,k`` (tool axis, tip to spindle; all three or none: 0, 0, 1), ``feed_mm_per_min`` (blank: as
before), ``rapid`` (1 or 0; blank: 0), ``operation``, ``tool``. Any order, any case. A column with
another name is an error: ignoring a misspelt ``rapid`` would cut where it should move rapidly.
"""

from __future__ import annotations

import csv
import difflib
import math
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import utf8_text
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.toolpath import FASTEST, Toolpath

POSITION: Final = ("x_mm", "y_mm", "z_mm")
AXIS: Final = ("i", "j", "k")
COLUMNS: Final = (*POSITION, *AXIS, "feed_mm_per_min", "rapid", "operation", "tool")
_YES, _NO = ("1", "true", "yes"), ("0", "false", "no", "")


def looks_like_csv(text: str) -> bool:
    """Returns whether a text begins with a header that names ``x_mm``."""
    for line in text.splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            return "x_mm" in line.lower()
    return False


def is_toolpath_header(text: str) -> bool:
    """Returns whether a table has the columns of a tool path and no others.

    Measurements and touched points have more.
    """
    for line in text.splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            names = {name.strip().lower() for name in line.replace(";", ",").split(",")}
            return set(POSITION) <= names <= set(COLUMNS)
    return False


def read_toolpath_csv(data: bytes, *, source: str) -> Toolpath:
    """Returns the tool path of a CSV file.

    Args:
        data: The bytes of the file; UTF-8, comma or semicolon, ``#`` begins a comment line.
        source: Its path, for messages; its stem names the path.

    Raises:
        FormatError: A column that is missing or not known, a cell that cannot be read; with line.
        ImplausibleDataError: No point, or a path larger than any part.
    """
    return toolpath_of(ToolpathTable(data, source))


def toolpath_of(table: ToolpathTable) -> Toolpath:
    """Returns the tool path of a table; raises as :func:`read_toolpath_csv`."""
    source = table.source
    position = table.block(POSITION) * MM
    axis = _axes(table)
    rapid = table.flags("rapid")
    operation, operations = table.words("operation", Path(source).stem)
    tool, tools = table.words("tool", "")
    starts = np.flatnonzero(np.diff(tool, prepend=-1))
    return Toolpath(
        name=Path(source).stem,
        source=source,
        position=position,
        axis=axis,
        feed=np.where(rapid, np.nan, table.feeds()),
        rapid=rapid,
        line=np.array(table.lines, dtype=np.int64),
        operation=operation,
        operations=operations,
        tools=tuple((tools[tool[k]], table.lines[k]) for k in starts if tools[tool[k]]),
    )


def _lines(data: bytes, source: str) -> list[tuple[int, str]]:
    """Returns the lines that hold cells, with their numbers."""
    text = utf8_text(data, source).replace("\r\n", "\n").replace("\r", "\n")
    return [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if (start := line.lstrip()[:1]) and start != "#"
    ]


def _split(line: str, mark: str, source: str, number: int) -> list[str]:
    if '"' not in line and len(line) < csv.field_size_limit():
        return line.split(mark)
    try:
        return next(csv.reader([line], delimiter=mark))
    except csv.Error as cause:
        raise FormatError(
            f"cannot be split into cells ({cause}).",
            source=source,
            line=number,
            hint="look for a stray quotation mark.",
        ) from None


def _header(header: list[str], source: str, line: int) -> list[str]:
    names = [name.lower() for name in header]
    for name in names:
        if name not in COLUMNS:
            near = difflib.get_close_matches(name, COLUMNS, n=1)
            raise FormatError(
                f"column {name!r} is unknown; known are {', '.join(COLUMNS)}.",
                source=source,
                line=line,
                hint=f"did you mean {near[0]}?" if near else "remove it.",
            )
        if names.count(name) > 1:
            raise FormatError(f"column {name!r} appears twice.", source=source, line=line)
    present = [name in names for name in AXIS]
    lacking = [name for name in POSITION if name not in names]
    lacking += [name for name in AXIS if any(present) and name not in names]
    if lacking:
        raise FormatError(
            f"no column {lacking[0]!r}.",
            source=source,
            line=line,
            hint="x_mm, y_mm, z_mm are needed; i, j, k come together or not at all.",
        )
    return names


def _axes(table: ToolpathTable) -> Array:
    if AXIS[0] not in table.names:
        return np.tile([0.0, 0.0, 1.0], (len(table.lines), 1))
    axis = table.block(AXIS)
    with np.errstate(over="ignore"):
        length = np.linalg.norm(axis, axis=1)
    bad = np.flatnonzero(np.abs(length - 1.0) > 0.01)
    if len(bad):
        raise FormatError(
            f"the tool axis i, j, k has length {length[bad[0]]:.4g}, expected 1.",
            source=table.source,
            line=table.lines[bad[0]],
        )
    return np.asarray(axis / length[:, None])


class ToolpathTable:
    """Cells of a CSV file by column name.

    Attributes:
        source: Path of the file.
        mark: Between cells.
        names: Of the columns, in order.
        lines: One-based line of each row.
    """

    def __init__(self, data: bytes, source: str) -> None:
        """Reads the cells; raises as :func:`read_toolpath_csv`."""
        lines = _lines(data, source)
        if len(lines) < 2:
            raise FormatError(
                "no row with a point.", source=source, line=1, hint="export the path again."
            )
        (line, header), *rows = lines
        self.mark = ";" if ";" in header else ","
        cells = [cell.strip() for cell in _split(header, self.mark, source, line)]
        self.source, self.names = source, _header(cells, source, line)
        self.lines = [line for line, _ in rows]
        width, every = len(self.names), []
        for line, text in rows:
            cells = _split(text, self.mark, source, line)
            if len(cells) != width:
                raise FormatError(
                    f"{len(cells)} cells, expected {width}.",
                    source=source,
                    line=line,
                    hint="look for a missing or a stray delimiter.",
                )
            every += cells
        self._columns = {name: every[k::width] for k, name in enumerate(self.names)}
        self._numbers_of: dict[str, list[float]] = {}

    def column(self, name: str) -> list[str]:
        """Returns the cells of a column, without blanks around them."""
        return [cell.strip() for cell in self._columns[name]]

    def block(self, names: tuple[str, ...]) -> Array:
        """Returns (n, k) finite numbers."""
        return np.array([self._numbers(name) for name in names], dtype=np.float64).T

    def feeds(self) -> Array:
        """Returns (n,) m/s; a blank cell keeps the feed of the row before."""
        if "feed_mm_per_min" not in self.names:
            return np.full(len(self.lines), np.nan)
        out, last = [], math.nan
        for cell, line in zip(self.column("feed_mm_per_min"), self.lines, strict=True):
            if cell:
                last = self._number(cell, "feed_mm_per_min", line) * MM / 60.0
                if not 0.0 < last <= FASTEST:
                    raise FormatError(
                        f"feed_mm_per_min is {cell}, expected above 0 and at most "
                        f"{60.0 * FASTEST / MM:g}.",
                        source=self.source,
                        line=line,
                    )
            out.append(last)
        return np.array(out, dtype=np.float64)

    def flags(self, name: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Returns (n,) flags."""
        if name not in self.names:
            return np.zeros(len(self.lines), np.bool_)
        out = []
        for cell, line in zip(self.column(name), self.lines, strict=True):
            if cell.lower() not in _YES + _NO:
                raise FormatError(
                    f"{name} is {cell!r}, expected 1 or 0.", source=self.source, line=line
                )
            out.append(cell.lower() in _YES)
        return np.array(out, dtype=np.bool_)

    def words(
        self, name: str, default: str
    ) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], tuple[str, ...]]:
        """Returns (n,) indices and their words; a blank keeps the one before."""
        if name not in self.names:
            return np.zeros(len(self.lines), np.int64), (default,)
        known: dict[str, int] = {}
        out, last = [], default
        for cell in self.column(name):
            last = cell or last
            out.append(known.setdefault(last, len(known)))
        return np.array(out, dtype=np.int64), tuple(known)

    def _numbers(self, name: str) -> list[float]:
        """Returns the finite numbers of a column; the first cell that holds none raises."""
        if name not in self._numbers_of:
            try:
                values = list(map(float, self._columns[name]))
            except ValueError:
                values = [math.nan]
            if not all(map(math.isfinite, values)):
                cells = zip(self.column(name), self.lines, strict=True)
                values = [self._number(cell, name, line) for cell, line in cells]
            self._numbers_of[name] = values
        return self._numbers_of[name]

    def _number(self, cell: str, name: str, line: int) -> float:
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise FormatError(
                f"{name} is {cell!r}, expected a finite number.",
                source=self.source,
                line=line,
                hint="the decimal mark is a point.",
            )
        return value
