"""Lists of named points as SpatialAnalyzer and PolyWorks read them: mm, one point in a line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import MM
from robotrue.measurement.formats.part_points import ONE_PART, POINT
from robotrue.measurement.formats.sheet import Sheet, write_six_digits

_SEPARATORS: Final = re.compile(r'[\s,;"]+')
"""Characters that separate cells; an underscore replaces them in names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointList(Columns):
    """n named points.

    Attributes:
        name: (n) of the points.
        group: (n) name of the group of each.
        frame: (n) frame of each in words.
        position: (n, 3) m, in that frame.
        provenance: Of the file they are from.
    """

    name: Annotated[tuple[str, ...], Column("n")]
    group: Annotated[tuple[str, ...], Column("n")]
    frame: Annotated[tuple[str, ...], Column("n")]
    position: Annotated[Array, Column("n 3", unit="m")]
    provenance: Provenance


def part_list(sheet: Sheet) -> PointList:
    """Returns the nominal points of a file of probing points; one row of equal features.

    Raises:
        FormatError: A cell is not a finite number, or a name is blank.
    """
    names, position = sheet.words("name"), sheet.numbers(POINT) * MM
    stated = sheet.has("part")
    parts = sheet.words("part") if stated else ONE_PART * len(names)
    places = zip(parts, names, map(tuple, position.tolist()), strict=True)
    rows = list({place: row for row, place in reversed(list(enumerate(places)))}.values())[::-1]
    return PointList(
        name=tuple(names[row] for row in rows),
        group=tuple(parts[row] for row in rows),
        frame=tuple(
            f"the frame of part {parts[row]!r}" if stated else "the part frame" for row in rows
        ),
        position=position[rows],
        provenance=sheet.provenance,
    )


def plain_list(points: PointList) -> str:
    """Returns lines ``name x y z`` with blanks between, as PolyWorks reads them."""
    return _mark(points) + "".join(f"{' '.join(cells)}\n" for _, *cells in _rows(points))


def comma_list(points: PointList, collection: str) -> str:
    """Returns lines ``collection, group, name, x, y, z`` with commas, as SpatialAnalyzer does."""
    first = _bare(collection)
    frames = dict(zip(points.group, points.frame, strict=True))
    head = "// millimetres\n" + "".join(
        f"// {_bare(group)}: in {frame}\n" for group, frame in frames.items()
    )
    lines = (",".join((first, *cells)) for cells in _rows(points))
    return _mark(points) + head + "".join(f"{line}\n" for line in lines)


def _mark(points: PointList) -> str:
    """The line that marks simulated points, as a comment of both."""
    return mark_line(points.provenance).replace("#", "//", 1)


def _rows(points: PointList) -> Iterator[tuple[str, ...]]:
    """Group, name, x, y, z of each; a name that repeats within its group gets a number."""
    groups = [_bare(group) for group in points.group]
    names = _unlike(groups, [_bare(name) for name in points.name])
    for group, name, point in zip(groups, names, points.position / MM, strict=True):
        yield group, name, *(write_six_digits(float(value)) for value in point)


def _bare(name: str) -> str:
    return _SEPARATORS.sub("_", name.strip()) or "_"


def _unlike(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    used: set[tuple[str, str]] = set()
    unlike: list[str] = []
    for group, name in zip(groups, names, strict=True):
        found, number = name, 1
        while (group, found) in used:
            number += 1
            found = f"{name}_{number}"
        used.add((group, found))
        unlike.append(found)
    return unlike
