"""A list of points and a list of joints as one sheet, row by row; nothing is dropped in silence.

:class:`JointList` states where the joints are and how the rows of both files find each other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from itertools import groupby
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import merge
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.joint_literals import read_joint_literals
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet

_CLOCK: Final = re.compile(r"(?:(\d+):)?(\d{1,2}):(\d{1,2}(?:\.\d+)?)")
_SECOND_BEST: Final = 0.8
"""A lag that joins this part of the rows of the best one is as likely."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pairs:
    """Rows that belong together.

    Attributes:
        joint: (k,) row of the joint list.
        point: (k,) row of the list of points, ascending.
        remark: How they were joined.
    """

    joint: list[int]
    point: list[int]
    remark: str


def read_joint_list(source: JointList) -> tuple[Sheet, bool]:
    """Returns the joint list as a sheet, and whether literals of a program are in rad.

    Raises:
        FormatError: It cannot be read.
    """
    literals = read_joint_literals(source.file)
    if literals is not None:
        return literals
    sheet = read_sheet(
        source.file,
        delimiter=source.delimiter,
        decimal=source.decimal,
        skip_lines=source.skip_lines,
    )
    return sheet, False


def join_sheets(joints: Sheet, points: Sheet, source: JointList) -> Sheet:
    """Returns one sheet with the columns of both, in the order of the points, and its remarks.

    Lines are those of the list of points. Several points may share one row of joints: repeated
    shots. Rows without a partner are named in the remarks, by line.

    Raises:
        FormatError: Counts that differ, names that repeat, invalid times, or no pair.
    """
    pairs = {"order": _join_by_order, "name": _join_by_name, "time": _join_by_time}[source.by](
        joints, points, source
    )
    if not pairs.joint:
        raise joints.fault(
            f"no row of {len(joints)} has a partner among {len(points)} in {_file(points)} by "
            f"{source.by}.",
            "look at the names or times of both files.",
        )
    remarks = [pairs.remark]
    for sheet, used in ((joints, pairs.joint), (points, pairs.point)):
        unused = sorted(set(range(len(sheet))) - set(used))
        if unused:
            remarks.append(
                f"{len(unused)} of {len(sheet)} rows of {_file(sheet)} have no partner: "
                f"{_describe_lines(sheet.lines[row] for row in unused)}"
            )
    return _put_together(joints, points, pairs, tuple(remarks))


def _put_together(joints: Sheet, points: Sheet, pairs: _Pairs, remarks: tuple[str, ...]) -> Sheet:
    header = [name + BESIDE if points.has(name) else name for name in joints.header]
    left, right = _with_points(joints), _with_points(points)
    units = (*(joints.units or ("",) * len(header)), *points.units) if joints.units else ()
    if points.units and not joints.units:
        units = (*("",) * len(header), *points.units)
    return replace(
        points,
        header=(*header, *points.header),
        cells=tuple((*left[j], *right[p]) for j, p in zip(pairs.joint, pairs.point, strict=True)),
        lines=tuple(points.lines[row] for row in pairs.point),
        decimal=".",
        units=units,
        provenance=merge([points.provenance, joints.provenance]),
        remarks=(*points.remarks, *joints.remarks, *remarks),
    )


def _with_points(sheet: Sheet) -> tuple[tuple[str, ...], ...]:
    """Returns the cells with a point as decimal mark; a cell with the other mark is no number."""
    if sheet.decimal == ".":
        return sheet.cells
    return tuple(
        tuple(cell.replace(",", ".") if "." not in cell else cell for cell in row)
        for row in sheet.cells
    )


def _join_by_order(joints: Sheet, points: Sheet, source: JointList) -> _Pairs:
    if len(joints) != len(points):
        raise joints.fault(
            f"{len(joints)} rows of joints, {len(points)} rows of points in {_file(points)}: their "
            "order does not determine the pairs.",
            'delete what is too much, or join by names or times: by = "name", by = "time".',
        )
    rows = list(range(len(points)))
    return _Pairs(joint=rows, point=rows, remark=f"{len(rows)} rows joined by their order")


def _join_by_name(joints: Sheet, points: Sheet, source: JointList) -> _Pairs:
    keys = [_keys(sheet, name) for sheet, name in zip((joints, points), source.keys, strict=True)]
    row_of: dict[str, int] = {}
    for row, key in enumerate(keys[0]):
        if key in row_of:
            raise joints.fault(
                f"name {key!r} is also on line {joints.lines[row_of[key]]}: which joints are its?",
                "rename one of them.",
                row=row,
            )
        row_of[key] = row
    found = [(row_of[key], row) for row, key in enumerate(keys[1]) if key in row_of]
    joint, point = [row for row, _ in found], [row for _, row in found]
    return _Pairs(joint=joint, point=point, remark=f"{len(point)} rows joined by name")


def _keys(sheet: Sheet, name: str) -> list[str]:
    return [column_key(word) for word in _require(sheet, name).words(name)]


def _require(sheet: Sheet, name: str) -> Sheet:
    if not sheet.has(name):
        raise sheet.lacking_columns(
            [name], "state joint_column and point_column under [joint_list]."
        )
    return sheet


def _join_by_time(joints: Sheet, points: Sheet, source: JointList) -> _Pairs:
    at_joint, at_point = (
        _times(sheet, name) for sheet, name in zip((joints, points), source.keys, strict=True)
    )
    tolerance = float(source.tolerance_s or 0.0)
    lag = float(source.lag_s) if source.lag_s != FIND else 0.0
    if source.lag_s == FIND:
        lag = _find_lag(joints, at_joint, at_point, tolerance)
    joint, point = _nearest(at_joint, at_point - lag, tolerance)
    apart = at_point[point] - at_joint[joint]
    median = float(np.median(apart)) if len(apart) else 0.0
    off = float(np.abs(apart - lag).max()) if len(apart) else 0.0
    remark = (
        f"{len(point)} rows joined by time within {tolerance:g} s of a lag of {lag:.3f} s: points "
        f"are {median:+.3f} s (median) from joints, the farthest {off:.3f} s off"
    )
    return _Pairs(joint=joint.tolist(), point=point.tolist(), remark=remark)


def _nearest(at_joint: Array, at_point: Array, tolerance: float) -> tuple[IntArray, IntArray]:
    """Returns rows (k,), (k,) of joints and points: of each point the joints nearest in time."""
    order = np.argsort(at_joint, kind="stable")
    ordered = at_joint[order]
    after = np.clip(np.searchsorted(ordered, at_point), 1, max(len(ordered) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(ordered) - 1)
    nearer = np.abs(ordered[before] - at_point) <= np.abs(ordered[after] - at_point)
    chosen = np.where(nearer, before, after)
    near = np.flatnonzero(np.abs(ordered[chosen] - at_point) <= tolerance)
    return order[chosen[near]], near


def _find_lag(joints: Sheet, at_joint: Array, at_point: Array, tolerance: float) -> float:
    """Returns the lag that joins most rows.

    Raises:
        FormatError: Another one joins nearly as many: stops at equal distances look alike.
    """
    apart = np.sort((at_point[:, None] - at_joint[None, :]).ravel())
    ends = np.searchsorted(apart, apart + tolerance, side="right")
    votes = ends - np.arange(len(apart))
    best = int(np.argmax(votes))
    lag = float(np.median(apart[best : ends[best]]))
    elsewhere = np.abs(apart - lag) > 2.0 * tolerance
    second = int(np.argmax(np.where(elsewhere, votes, 0)))
    if elsewhere[second] and votes[second] >= _SECOND_BEST * votes[best]:
        raise joints.fault(
            f"the lag is not plain: {lag:.3f} s joins {votes[best]} rows, {apart[second]:.3f} s "
            f"joins {votes[second]}.",
            "state lag_s, the tracker's clock minus the controller's, or join by name.",
        )
    return lag


def _times(sheet: Sheet, name: str) -> Array:
    """Returns a column of seconds, clock times or ISO dates as seconds (n,)."""
    values = _require(sheet, name).parse(name)
    cells = sheet.column(name)
    for row in np.flatnonzero(~np.isfinite(values)).tolist():
        values[row] = _seconds(cells[row].replace(",", "."))
        if not np.isfinite(values[row]):
            message = f"column {name!r} is {cells[row] or 'blank'}, expected a time."
            raise sheet.fault(message, "seconds, 12:34:56.7 or 2026-11-23T12:34:56.7.", row=row)
    return values


def _seconds(cell: str) -> float:
    clock = _CLOCK.fullmatch(cell.strip())
    if clock:
        return 3600.0 * float(clock[1] or 0) + 60.0 * float(clock[2]) + float(clock[3])
    try:
        return datetime.fromisoformat(cell.strip()).timestamp()
    except ValueError:
        return float("nan")


def _describe_lines(lines: Iterable[int]) -> str:
    """Returns e.g. ``lines 3, 7-12``."""
    runs = []
    for _, run in groupby(enumerate(sorted(lines)), lambda pair: pair[1] - pair[0]):
        numbers: Sequence[int] = [line for _, line in run]
        first, last = numbers[0], numbers[-1]
        runs.append(f"{first}" if first == last else f"{first}-{last}")
    plural = "" if len(runs) == 1 and "-" not in runs[0] else "s"
    return f"line{plural} {', '.join(runs)}"


def _file(sheet: Sheet) -> str:
    return Path(sheet.source).name


JoinRule: TypeAlias = Literal["order", "name", "time"]
BESIDE: Final = " (joint list)"
"""Follows the name of a column of the joint list where the points have one of that name."""
FIND: Final = "find"
"""In place of a lag: look for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointList:
    """A second file that holds the joints: ``[joint_list]`` of a column mapping.

    Attributes:
        file: A table, or lines of a program: RAPID ``jointtarget``, KRL ``E6AXIS``, Fanuc
            positions, URScript lists.
        by: How rows find each other: in their order, by equal names, by the nearest time.
        joint_column: Name or time in the joint list.
        point_column: Name or time in the list of points; empty: called as in the joint list.
        tolerance_s: Farthest two times of one row may lie apart.
        lag_s: The tracker's clock minus the controller's; ``"find"`` looks for it.
        delimiter: Of a table, None finds out.
        decimal: Of a table, None finds out.
        skip_lines: Of a table, lines before its header.
    """

    file: Path
    by: JoinRule = "order"
    joint_column: str = ""
    point_column: str = ""
    tolerance_s: float | None = None
    lag_s: float | str = 0.0
    delimiter: str | None = None
    decimal: str | None = None
    skip_lines: int = 0

    def __post_init__(self) -> None:
        """Checks the rule, and that a join by time states its tolerance.

        Raises:
            ConfigurationError: It does not, or the rule is unknown.
        """
        if self.by not in get_args(JoinRule):
            raise ConfigurationError(
                f"joint_list.by is {self.by!r}, allowed: {', '.join(get_args(JoinRule))}."
            )
        if self.by == "time" and not (self.tolerance_s and self.tolerance_s > 0.0):
            raise ConfigurationError(
                f"joint_list.tolerance_s is {self.tolerance_s}, a join by time needs seconds above "
                "0.",
                hint="half the shortest stop at a pose, for example tolerance_s = 1.0.",
            )
        if isinstance(self.lag_s, str) and self.lag_s != FIND:
            raise ConfigurationError(f"joint_list.lag_s is {self.lag_s!r}, allowed: {FIND!r}.")

    @property
    def keys(self) -> tuple[str, str]:
        """Columns of names or times: in the joint list, and in the list of points."""
        joint = self.joint_column or self.point_column or self.by
        return joint.removesuffix(BESIDE), self.point_column or joint


def build_joint_list(stated: object, source: Path | None) -> JointList:
    """Returns a joint list from its fields by name; its file lies next to ``source``.

    Raises:
        ConfigurationError: An unknown field, or one of a kind it cannot have.
    """
    known = {field.name for field in fields(JointList)}
    if not isinstance(stated, Mapping) or "file" not in stated or set(stated) - known:
        odd = sorted(set(stated) - known) if isinstance(stated, Mapping) else []
        raise ConfigurationError(
            f"joint_list {'has no key ' + repr(odd[0]) if odd else 'names no file'}; "
            f"known are {', '.join(sorted(known))}.",
            source=source,
        )
    values: dict[str, object] = dict(stated)
    folder = Path() if source is None else source.parent
    values["file"] = folder / str(values["file"])
    return decode(JointList, values, key="joint_list", error=ConfigurationError, source=source)
