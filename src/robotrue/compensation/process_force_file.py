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
in path axes, or ``csv = "forces.csv"``, a file next to it with one column ``line``, ``target`` or
``path_mm``, the columns ``fx_N, fy_N, fz_N`` and, if need be, ``mx_Nm, my_Nm, mz_Nm``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias, TypeVar, get_args

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from robotrue.compensation.process_force import (
    Axes,
    DescribedForce,
    ForceRule,
    ForceTable,
    Key,
    Part,
)
from robotrue.core.arrays import Array
from robotrue.core.files import read_toml
from robotrue.core.schema_faults import line_of_key
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.program.program import Motion

Move: TypeAlias = Literal["line", "arc", "spline"]
MOVES: Final[Mapping[Move, tuple[Motion, ...]]] = {
    "line": (Motion.LIN,),
    "arc": (Motion.ARC_VIA, Motion.ARC_END),
    "spline": (Motion.SPLINE,),
}
KEYS: Final[tuple[Key, ...]] = get_args(Key)
FORCES: Final = ("fx_N", "fy_N", "fz_N")
MOMENTS: Final = ("mx_Nm", "my_Nm", "mz_Nm")
Milling: TypeAlias = Callable[[Mapping[str, object]], Array]
"""From the keys of ``milling`` to a wrench (6,) N, N m in path axes."""
Fault: TypeAlias = Callable[[str, str, str | None], ConfigurationError]
"""From a key of a table, or "" for the table itself, message and hint to the error."""
LARGEST: Final = 1e5
"""N or N m; more is another unit."""
T = TypeVar("T", int, float)


def read_force(path: str | Path, *, milling: Milling | None = None) -> DescribedForce:
    """Returns the description in a file: TOML, or one CSV table in base axes.

    Args:
        path: The file; what does not end in ``.toml`` is a table.
        milling: What makes a wrench of the keys of ``milling``.

    Raises:
        ConfigurationError: Not TOML, an unknown key or an invalid value; with file and line.
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
    def fault_at(*where: str | int) -> Fault:
        def fault(key: str, message: str, hint: str | None) -> ConfigurationError:
            line = line_of_key(text, (*where, key) if key else where)
            return ConfigurationError(f"{message}.", source=path, line=line, hint=hint)

        return fault

    fault = fault_at()
    for key in stated:
        if key != "force":
            raise fault(key, f"unknown key {key}", "the tables are [[force]].")
    tables = stated.get("force")
    if not isinstance(tables, list) or not tables:
        raise fault("force", "no [[force]] table", '[[force]] with axes = "path".')
    out: list[Part] = []
    for k, table in enumerate(tables):
        if not isinstance(table, dict):
            raise fault("force", "force is no table", "write [[force]].")
        try:
            out.append(_read_part(path, k, table, fault_at("force", k), milling))
        except RobotrueError as cause:
            if cause.source is not None:
                raise
            raise fault_at("force", k)(
                "", cause.message.removesuffix("."), cause.hint or ""
            ) from None
    return tuple(out)


def _check_rising(pair: list[T]) -> list[T]:
    if not pair[0] <= pair[1]:
        raise ValueError("the first is above the last")
    return pair


_Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
_Three = Annotated[list[_Bounded], Field(min_length=3, max_length=3)]
_Line = Annotated[int, Field(ge=1, lt=2**63)]
_Feed = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Range = Annotated[list[_Line], Field(min_length=2, max_length=2), AfterValidator(_check_rising)]
_Feeds = Annotated[list[_Feed], Field(min_length=2, max_length=2), AfterValidator(_check_rising)]


class _ForceEntry(BaseModel):
    """One ``[[force]]`` table."""

    model_config = ConfigDict(strict=True, frozen=True)
    name: str = ""
    axes: Axes | None = None
    force_N: _Three | None = None
    moment_Nm: _Three = [0.0, 0.0, 0.0]
    lines: Annotated[list[_Range], Field(min_length=1)] | None = None
    moves: Annotated[list[Move], Field(min_length=1)] = ["line", "arc", "spline"]
    feeds_mm_per_s: _Feeds | None = None
    program: str = ""
    csv: str = ""
    milling: object = None


_EXPECTED: Final[Mapping[str, str]] = {
    "axes": "base, tool or path; path with milling",
    "force_N": f"three numbers of at most {LARGEST:g}, such as [120.0, -40.0, -60.0]",
    "moment_Nm": f"three numbers of at most {LARGEST:g}, such as [0.0, 0.0, 1.2]",
    "lines": "ranges of whole numbers, first and last, such as [[120, 480], [500, 500]]",
    "moves": f"some of {', '.join(MOVES)}, such as ['line', 'arc']",
    "feeds_mm_per_s": "the lowest and the highest, such as [1.0, 60.0]",
}
"""What is allowed; text in quotes elsewhere."""


def _read_part(
    path: Path, number: int, stated: Mapping[str, object], fault: Fault, milling: Milling | None
) -> Part:
    """Returns the part of a description that a table states."""
    source = _find_source(stated, fault)
    try:
        entry = _ForceEntry.model_validate(stated)
    except ValidationError as cause:
        key = str(cause.errors()[0]["loc"][0])
        what = f"{key} is {stated[key]!r}, expected {_EXPECTED.get(key, 'text in quotes')}"
        raise fault(key, what, f"correct {key}, or leave it out.") from None
    axes = entry.axes or ("path" if source == "milling" else "base")
    if source == "milling" and axes != "path":
        raise fault("axes", f"axes is {axes!r}, expected path with milling", 'axes = "path".')
    if source == "csv":
        beside = [k for k in ("moment_Nm", "lines", "moves", "feeds_mm_per_s") if k in stated]
        if beside:
            hint = "leave it out: the table states the forces and their places."
            raise fault(beside[0], f"{beside[0]} is given together with csv", hint)
        return read_force_table(
            path.parent / entry.csv,
            name=entry.name if "name" in stated else entry.csv,
            axes=axes,
            program=entry.program,
        )
    wrench = np.array([*(entry.force_N or [0.0, 0.0, 0.0]), *entry.moment_Nm])
    if source == "milling":
        if milling is None or not isinstance(entry.milling, dict):
            raise fault("milling", "milling is no table", "milling = { kind = ... }.")
        wrench += milling(entry.milling)
    feeds = entry.feeds_mm_per_s
    return ForceRule(
        name=entry.name if "name" in stated else f"force {number + 1}",
        axes=axes,
        wrench=wrench,
        lines=np.array(entry.lines or [], dtype=np.int64).reshape(-1, 2),
        motions=tuple(motion for name in entry.moves for motion in MOVES[name]),
        feeds=None if feeds is None else (feeds[0] * MM, feeds[1] * MM),
        program=entry.program,
    )


def _find_source(stated: Mapping[str, object], fault: Fault) -> str:
    """Returns the key that states the size of the force."""
    for key in stated:
        if key not in _ForceEntry.model_fields:
            known = f"known are {', '.join(_ForceEntry.model_fields)}."
            raise fault(key, f"unknown key {key} in [[force]]", known)
    sources = [key for key in ("force_N", "milling", "csv") if key in stated]
    if len(sources) != 1:
        said = " and ".join(sources) if sources else "neither force_N nor milling nor csv"
        hint = "one of force_N, milling and csv states the size of the force."
        raise fault("", f"{said} in one [[force]]", hint)
    return sources[0]


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
