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
from typing import Any, Final, TypeAlias, get_args

import numpy as np

from robotrue.cell.schema_faults import line_of_key
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
from robotrue.core.toml_text import read_toml
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.program.program import Motion

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
Milling: TypeAlias = Callable[[Mapping[str, Any]], Array]
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
    path: Path, text: str, stated: Mapping[str, Any], milling: Milling | None
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
            out.append(_part(path, text, k, table, milling))
        except RobotrueError as cause:
            if cause.source is not None:
                raise
            line = line_of_key(text, ("force", k))
            raise ConfigurationError(
                cause.message, source=path, line=line, hint=cause.hint
            ) from None
    return tuple(out)


def _part(path: Path, text: str, k: int, table: Mapping[str, Any], milling: Milling | None) -> Part:
    for key in table:
        if key not in ENTRIES:
            known = f"known are {', '.join(ENTRIES)}."
            raise _fault(path, text, ("force", k, key), f"unknown key {key} in [[force]]", known)
    sources = [key for key in ("force_N", "milling", "csv") if key in table]
    if len(sources) != 1:
        said = " and ".join(sources) if sources else "neither force_N nor milling nor csv"
        hint = "one of force_N, milling and csv says how large the force is."
        raise _fault(path, text, ("force", k), f"{said} in one [[force]]", hint)
    source = sources[0]
    axes = _word(path, text, k, table, "axes", "path" if source == "milling" else "base")
    if axes not in get_args(Axes) or (source == "milling" and axes != "path"):
        hint = "base, tool or path; path with milling."
        raise _fault(path, text, ("force", k, "axes"), f"axes is {axes!r}", hint)
    name = _word(path, text, k, table, "name", f"force {k + 1}")
    program = _word(path, text, k, table, "program", "")
    if source == "csv":
        beside = [key for key in ("moment_Nm", "lines", "moves", "feeds_mm_per_s") if key in table]
        if beside:
            hint = "leave it out: the table says where which force acts."
            where = ("force", k, beside[0])
            raise _fault(path, text, where, f"{beside[0]} stands beside csv", hint)
        file = _word(path, text, k, table, "csv", "")
        name = name if "name" in table else file
        return read_force_table(path.parent / file, name=name, axes=_axes(axes), program=program)
    moment = _three(path, text, k, "moment_Nm", table.get("moment_Nm", [0.0, 0.0, 0.0]))
    if source == "force_N":
        force = _three(path, text, k, "force_N", table["force_N"])
        wrench = np.concatenate([force, moment])
    else:
        cut = table["milling"]
        if milling is None or not isinstance(cut, dict):
            where = ("force", k, "milling")
            raise _fault(path, text, where, "milling is no table", "milling = { kind = ... }.")
        wrench = milling(cut) + np.concatenate([np.zeros(3), moment])
    return ForceRule(
        name=name,
        axes=_axes(axes),
        wrench=wrench,
        lines=_lines(path, text, k, table.get("lines")),
        motions=_moves(path, text, k, table.get("moves")),
        feeds=_feeds(path, text, k, table.get("feeds_mm_per_s")),
        program=program,
    )


def _word(path: Path, text: str, k: int, table: Mapping[str, Any], key: str, default: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise _fault(path, text, ("force", k, key), f"{key} is {value!r}", "text in quotes.")
    return value


def _axes(name: str) -> Axes:
    return "base" if name == "base" else "tool" if name == "tool" else "path"


def _three(path: Path, text: str, k: int, key: str, value: object) -> Array:
    numbers: list[Any] = value if isinstance(value, list) else []
    good = all(type(v) in (int, float) and abs(v) <= LARGEST for v in numbers)
    if not (good and len(numbers) == 3):
        raise _fault(
            path,
            text,
            ("force", k, key),
            f"{key} is {value!r}, expected three numbers of at most {LARGEST:g}",
            f"{key} = [120.0, -40.0, -60.0].",
        )
    return np.array(numbers, dtype=np.float64)


def _lines(path: Path, text: str, k: int, value: object) -> IntArray:
    """Ranges (r, 2) of lines; empty if none is stated."""
    if value is None:
        return np.empty((0, 2), dtype=np.int64)
    ranges: list[Any] = value if isinstance(value, list) and value else [None]
    for each in ranges:
        good = isinstance(each, list) and len(each) == 2 and all(type(v) is int for v in each)
        if not (good and 1 <= each[0] <= each[1] < 2**63):
            raise _fault(
                path,
                text,
                ("force", k, "lines"),
                f"lines is {value!r}, expected ranges of whole numbers, first and last",
                "lines = [[120, 480], [500, 500]].",
            )
    return np.array(ranges, dtype=np.int64)


def _moves(path: Path, text: str, k: int, value: object) -> tuple[Motion, ...]:
    if value is None:
        return FEEDING
    names: list[Any] = value if isinstance(value, list) and value else [value]
    if not all(isinstance(name, str) and name in MOVES for name in names):
        raise _fault(
            path,
            text,
            ("force", k, "moves"),
            f"moves is {value!r}, expected some of {', '.join(MOVES)}",
            'moves = ["line", "arc"].',
        )
    return tuple(motion for name in names for motion in MOVES[name])


def _feeds(path: Path, text: str, k: int, value: object) -> tuple[float, float] | None:
    """Lowest and highest feed, m/s; None if none is stated."""
    if value is None:
        return None
    pair: list[Any] = value if isinstance(value, list) else []
    good = len(pair) == 2 and all(type(v) in (int, float) for v in pair)
    if not (good and 0.0 <= pair[0] <= pair[1] < np.inf):
        raise _fault(
            path,
            text,
            ("force", k, "feeds_mm_per_s"),
            f"feeds_mm_per_s is {value!r}, expected the lowest and the highest",
            "feeds_mm_per_s = [1.0, 60.0].",
        )
    return float(pair[0]) * MM, float(pair[1]) * MM


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
