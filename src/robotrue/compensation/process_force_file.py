"""Descriptions of a process force as files: TOML of rules, CSV of forces by place.

The TOML file holds ``[[force]]`` tables::

    [[force]]
    axes = "path"                # base, tool, or path: feed, left of it, tool axis
    force_N = [-40.0, 120.0, -60.0]
    moment_Nm = [0.0, 0.0, 1.2]  # if it matters
    lines = [[120, 480]]         # ranges; without it: everywhere no other table names
    moves = ["line", "arc"]      # kinds that cut: line, arc, spline; all three if not given
    feeds_mm_per_s = [1.0, 60.0] # of moves that cut, if their feed is stated
    program = "part.src"         # where a job has several files

or, instead of ``force_N``, ``milling = { ... }``, a cut whose mean force a model of milling gives
in path axes, or ``csv = "forces.csv"``, a file beside it with one column ``line``,
``target`` or ``path_mm``, the columns ``fx_N, fy_N, fz_N`` and, if need be,
``mx_Nm, my_Nm, mz_Nm``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, TypeAlias, TypeGuard, get_args

import numpy as np

from robotrue.compensation.process_force import (
    FEEDING,
    Axes,
    DescribedForce,
    ForceRule,
    ForceTable,
    Key,
    Part,
)
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import read_toml
from robotrue.core.schema_faults import line_of_key
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.program.program import Motion

AXES: Final[tuple[Axes, ...]] = get_args(Axes)
_AXES: Final = "base, tool or path; path with milling."
MOVES: Final[Mapping[str, tuple[Motion, ...]]] = {
    "line": (Motion.LIN,),
    "arc": (Motion.ARC_VIA, Motion.ARC_END),
    "spline": (Motion.SPLINE,),
}
KEYS: Final[tuple[Key, ...]] = get_args(Key)
FORCES: Final = ("fx_N", "fy_N", "fz_N")
MOMENTS: Final = ("mx_Nm", "my_Nm", "mz_Nm")
ENTRIES: Final = (
    "name", "axes", "force_N", "moment_Nm", "lines", "moves", "program", "csv", "milling",
    "feeds_mm_per_s",
)  # fmt: skip
Milling: TypeAlias = Callable[[Mapping[str, object]], Array]
"""From the keys of ``milling`` to a wrench (6,) N, N m in path axes."""
LARGEST: Final = 1e5
"""N or N m; more is another unit."""


def read_force(path: str | Path, *, milling: Milling | None = None) -> DescribedForce:
    """Returns the description in a file: TOML, or one CSV table in base axes.

    Args:
        path: The file; what does not end in ``.toml`` is a table.
        milling: What makes a wrench of the keys of ``milling``.

    Raises:
        ConfigurationError: Not TOML, an unknown key or a value that cannot be; with file and line.
        FormatError: A file that cannot be read, or a table that is not one.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        table = read_force_table(path, name=path.name, axes="base", program="")
        return DescribedForce(parts=(table,))
    stated, text = read_toml(path, example="the guide on process force")
    return DescribedForce(parts=_parts(path, text, stated, milling))


def _parts(
    path: Path, text: str, stated: Mapping[str, object], milling: Milling | None
) -> tuple[Part, ...]:
    for key in stated:
        if key != "force":
            raise _fault(path, text, (key,), f"unknown key {key}", "the tables are [[force]].")
    tables = stated.get("force")
    if not isinstance(tables, list) or not tables:
        raise _fault(path, text, ("force",), "no [[force]] table", '[[force]] with axes = "path".')
    out: list[Part] = []
    for k, table in enumerate(tables):
        if not isinstance(table, dict):
            raise _fault(path, text, ("force",), "force is no table", "write [[force]].")
        try:
            out.append(_ForceEntry(path, text, k, table).read_part(milling))
        except RobotrueError as cause:
            if cause.source is not None:
                raise
            line = line_of_key(text, ("force", k))
            raise ConfigurationError(
                cause.message, source=path, line=line, hint=cause.hint
            ) from None
    return tuple(out)


class _ForceEntry:
    """One ``[[force]]`` table, and where it stands."""

    def __init__(self, path: Path, text: str, number: int, stated: Mapping[str, object]) -> None:
        self.path, self.stated = path, stated
        self._text, self._number = text, number

    def fault(self, key: str, message: str, hint: str) -> ConfigurationError:
        """Returns an error at a key, or at the table where that is empty."""
        where = ("force", self._number, key) if key else ("force", self._number)
        return _fault(self.path, self._text, where, message, hint)

    def read_part(self, milling: Milling | None) -> Part:
        """Returns the part of a description that the table states."""
        stated, source = self.stated, self._source()
        axes = self._axes("path" if source == "milling" else "base")
        if source == "milling" and axes != "path":
            raise self.fault("axes", f"axes is {axes!r}", _AXES)
        name, program = self._word("name", f"force {self._number + 1}"), self._word("program", "")
        if source == "csv":
            beside = [k for k in ("moment_Nm", "lines", "moves", "feeds_mm_per_s") if k in stated]
            if beside:
                hint = "leave it out: the table says where which force acts."
                raise self.fault(beside[0], f"{beside[0]} stands beside csv", hint)
            file = self._word("csv", "")
            name = name if "name" in stated else file
            return read_force_table(self.path.parent / file, name=name, axes=axes, program=program)
        moment = self._three("moment_Nm") if "moment_Nm" in stated else np.zeros(3)
        if source == "force_N":
            wrench = np.concatenate([self._three("force_N"), moment])
        elif milling is None or not isinstance(stated["milling"], dict):
            raise self.fault("milling", "milling is no table", "milling = { kind = ... }.")
        else:
            wrench = milling(stated["milling"]) + np.concatenate([np.zeros(3), moment])
        return ForceRule(
            name=name,
            axes=axes,
            wrench=wrench,
            lines=self._lines(),
            motions=self._moves(),
            feeds=self._feeds(),
            program=program,
        )

    def _source(self) -> str:
        """Returns which key says how large the force is."""
        for key in self.stated:
            if key not in ENTRIES:
                known = f"known are {', '.join(ENTRIES)}."
                raise self.fault(key, f"unknown key {key} in [[force]]", known)
        sources = [key for key in ("force_N", "milling", "csv") if key in self.stated]
        if len(sources) != 1:
            said = " and ".join(sources) if sources else "neither force_N nor milling nor csv"
            hint = "one of force_N, milling and csv says how large the force is."
            raise self.fault("", f"{said} in one [[force]]", hint)
        return sources[0]

    def _word(self, key: str, default: str) -> str:
        value = self.stated.get(key, default)
        if not isinstance(value, str):
            raise self.fault(key, f"{key} is {value!r}", "text in quotes.")
        return value

    def _axes(self, default: Axes) -> Axes:
        word = self._word("axes", default)
        for axes in AXES:
            if word == axes:
                return axes
        raise self.fault("axes", f"axes is {word!r}", _AXES)

    def _list(self, key: str) -> list[object]:
        """Returns the values of a key; none if they are no list."""
        value = self.stated[key]
        return value if isinstance(value, list) else []

    def _expect(self, key: str, what: str, example: str) -> ConfigurationError:
        message = f"{key} is {self.stated[key]!r}, expected {what}"
        return self.fault(key, message, f"{key} = {example}.")

    def _three(self, key: str) -> Array:
        numbers = [v for v in self._list(key) if _is_number(v)]
        if len(numbers) != 3 or len(self._list(key)) != 3 or not np.all(np.abs(numbers) <= LARGEST):
            what = f"three numbers of at most {LARGEST:g}"
            raise self._expect(key, what, "[120.0, -40.0, -60.0]")
        return np.array(numbers, dtype=np.float64)

    def _lines(self) -> IntArray:
        """Ranges (r, 2) of lines; empty if none is stated."""
        if "lines" not in self.stated:
            return np.empty((0, 2), dtype=np.int64)
        ranges = self._list("lines")
        for lines in ranges or [None]:
            pair = lines if isinstance(lines, list) else []
            good = len(pair) == 2 and all(type(v) is int for v in pair)
            if not (good and 1 <= pair[0] <= pair[1] < 2**63):
                what = "ranges of whole numbers, first and last"
                raise self._expect("lines", what, "[[120, 480], [500, 500]]")
        return np.array(ranges, dtype=np.int64)

    def _moves(self) -> tuple[Motion, ...]:
        if "moves" not in self.stated:
            return FEEDING
        stated = self._list("moves")
        names = [name for name in stated if isinstance(name, str) and name in MOVES]
        if not stated or len(names) < len(stated):
            raise self._expect("moves", f"some of {', '.join(MOVES)}", '["line", "arc"]')
        return tuple(motion for name in names for motion in MOVES[name])

    def _feeds(self) -> tuple[float, float] | None:
        """Lowest and highest feed, m/s; None if none is stated."""
        if "feeds_mm_per_s" not in self.stated:
            return None
        stated = self._list("feeds_mm_per_s")
        pair = [v for v in stated if _is_number(v)]
        if not (len(pair) == len(stated) == 2 and 0.0 <= pair[0] <= pair[1] < np.inf):
            raise self._expect("feeds_mm_per_s", "the lowest and the highest", "[1.0, 60.0]")
        return float(pair[0]) * MM, float(pair[1]) * MM


def _is_number(value: object) -> TypeGuard[float]:
    return type(value) in (int, float)


def read_force_table(path: Path, *, name: str, axes: Axes, program: str) -> ForceTable:
    """Returns a CSV, TSV or workbook of forces by line, target or length of path.

    Args:
        path: The file; its columns are in the head of this module.
        name: For messages.
        axes: What the forces are written in.
        program: File of the targets; empty for any.

    Raises:
        FormatError: A missing or unknown column, a cell that is no such number; with its line.
    """
    sheet = read_sheet(path)
    known = {column_key(each): each for each in (*KEYS, *FORCES, *MOMENTS)}
    strange = [each for each in sheet.header if column_key(each) not in known]
    keys = [each for each in KEYS if sheet.has(each)]
    stated = (*FORCES, *MOMENTS) if any(map(sheet.has, MOMENTS)) else FORCES
    lacking = [each for each in stated if not sheet.has(each)]
    if strange or lacking or len(keys) != 1:
        what = f"unknown column {strange[0]!r}" if strange else f"no column {(lacking or [''])[0]}"
        if not strange and not lacking:
            what = "one column line, target or path_mm is needed, here "
            what += f"are {' and '.join(keys)}" if keys else "is none"
        raise sheet.fault(f"{what}.", "path_mm,fx_N,fy_N,fz_N")
    at = _places(sheet, keys[0])
    wrench = np.zeros((len(sheet), 6))
    wrench[:, : len(stated)] = sheet.numbers(stated)
    for row, k in np.argwhere(np.abs(wrench) > LARGEST).tolist():
        raise sheet.fault(
            f"{stated[k]} is {wrench[row, k]:g}, expected at most {LARGEST:g}.",
            "forces are in N, moments in N m.",
            row=row,
        )
    return ForceTable(
        name=name,
        axes=axes,
        key=keys[0],
        at=at,
        wrench=wrench,
        source=sheet.source,
        rows=np.array(sheet.lines, dtype=np.int64),
        program=program,
    )


def _places(sheet: Sheet, key: Key) -> Array:
    """Lines and target numbers, or m of path."""
    out: Array = sheet.numbers((key,))[:, 0]
    if key == "path_mm":
        return out * MM
    bad = np.flatnonzero((out != np.rint(out)) | (out < 1.0) | (out > 2.0**53))
    if len(bad):
        raise sheet.fault(
            f"{key} is {sheet.column(key)[int(bad[0])]}, expected a whole number from 1.",
            "count lines and targets from 1.",
            row=int(bad[0]),
        )
    return out


def _fault(
    path: Path, text: str, where: tuple[str | int, ...], message: str, hint: str
) -> ConfigurationError:
    return ConfigurationError(f"{message}.", source=path, line=line_of_key(text, where), hint=hint)
