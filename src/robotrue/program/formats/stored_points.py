"""Points a program keeps in variables: which literal a motion moves to, and which is not certain.

A variable that is given one literal in the whole program is that literal everywhere. One that is
given several is, at a motion, the one given last, if nothing but plain statements lies between; and
a variable that takes part in a computation is not certain anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.program import Motion, Reason


@dataclass(slots=True)
class Variable:
    """One variable.

    Attributes:
        kind: What it holds, in the language's own word.
        points: Number of the point last given, by subscript; empty for a scalar.
        given: Barriers passed when each was given.
        all: Every point it was ever given, by subscript.
        is_array: It has subscripts.
        outside: A parameter, or imported: its value is not in this program.
        computed: It takes part in a computation.
    """

    kind: str
    points: dict[str, int] = field(default_factory=dict)
    given: dict[str, int] = field(default_factory=dict)
    all: dict[str, list[int]] = field(default_factory=dict)
    is_array: bool = False
    outside: bool = False
    computed: bool = False

    def give(self, subscript: str, point: int, barriers: int) -> None:
        """Gives an element a literal."""
        self.points[subscript] = point
        self.given[subscript] = barriers
        self.all.setdefault(subscript, []).append(point)


class Variables:
    """All variables, by scope and name; names are compared as the caller spells them."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Variable] = {}
        self._uncertain: dict[tuple[int, str], Variable] = {}

    def declare(self, scope: str, name: str, kind: str) -> Variable:
        """Returns the variable of this scope, new if it is not known there."""
        return self._known.setdefault((scope, name), Variable(kind))

    def find(self, scope: str, name: str) -> Variable | None:
        """Returns the variable a name means inside a scope."""
        return self._known.get((scope, name)) or self._known.get(("", name))

    def points_at(self, variable: Variable, subscript: str | None, barriers: int) -> list[int]:
        """Returns the points a motion may move to; ``None`` as subscript is any element."""
        points, unsure = self.look_up(variable, subscript, barriers)
        self.doubt(variable, unsure)
        return points

    def look_up(
        self, variable: Variable, subscript: str | None, barriers: int
    ) -> tuple[list[int], list[str]]:
        """Returns the points a motion may move to, and the subscripts given elsewhere."""
        asked = list(variable.points) if subscript is None else [subscript]
        found = [each for each in asked if each in variable.points]
        unsure = [each for each in found if variable.given[each] != barriers]
        return [variable.points[each] for each in found], unsure

    def doubt(self, variable: Variable, subscripts: list[str]) -> None:
        """Notes that it is not certain which of their values elements have where they are used."""
        for each in subscripts:
            self._uncertain[id(variable), each] = variable

    def uncertain(self) -> set[int]:
        """Returns the points of which it is not certain that they are what is moved to."""
        out: set[int] = set()
        for variable in self._known.values():
            if variable.computed or variable.outside:
                out.update(point for points in variable.all.values() for point in points)
        for (_, subscript), variable in self._uncertain.items():
            if len(variable.all[subscript]) > 1:
                out.update(variable.all[subscript])
        return out


@dataclass(slots=True)
class Uses:
    """What is moved to, as columns.

    Attributes:
        point: Number of the point.
        place: Of the motion, growing from statement to statement.
        motion: :class:`~robotrue.program.program.Motion`.
        setting: Number of the pair of work frame and tool named there.
    """

    point: list[int] = field(default_factory=list)
    place: list[int] = field(default_factory=list)
    motion: list[int] = field(default_factory=list)
    setting: list[int] = field(default_factory=list)

    def add(self, point: int, place: int, motion: int, setting: int) -> None:
        """Adds one motion."""
        self.point.append(point)
        self.place.append(place)
        self.motion.append(motion)
        self.setting.append(setting)

    def extend(self, points: range, places: range, motion: int, setting: int) -> None:
        """Adds motions of one kind to points in turn."""
        self.point.extend(points)
        self.place.extend(places)
        self.motion.extend([motion] * len(points))
        self.setting.extend([setting] * len(points))


@dataclass(slots=True)
class ParsedPoints:
    """What the walk through a file collects of its points.

    Attributes:
        offset: First byte of every point.
        row: Its row in the table of numbers, -1 if it has none.
        kind: In the language's own word.
        uses: What is moved to.
        flags: Reasons of points, found in the text.
        arcs: Pairs of points: via and end.
        notes: (byte, text of the note).
    """

    offset: list[int] = field(default_factory=list)
    row: list[int] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)
    uses: Uses = field(default_factory=Uses)
    flags: dict[int, Reason] = field(default_factory=dict)
    arcs: list[tuple[int, int]] = field(default_factory=list)
    notes: list[tuple[int, str]] = field(default_factory=list)

    def add(self, offset: int, row: int, kind: int) -> int:
        """Returns the number of a new point."""
        self.offset.append(offset)
        self.row.append(row)
        self.kind.append(kind)
        return len(self.offset) - 1

    def extend(self, offsets: Sequence[int], rows: range, kind: int) -> range:
        """Returns the numbers of new points of one kind."""
        points = range(len(self.offset), len(self.offset) + len(rows))
        self.offset.extend(offsets)
        self.row.extend(rows)
        self.kind.extend([kind] * len(rows))
        return points


def moves_to(uses: Uses, rows: IntArray) -> IntArray:
    """Returns ``Program.path`` (k, 3) of what is moved to; empty where that is file order.

    Args:
        uses: The motions.
        rows: (n,) row of every point in the program, -1 without one.
    """
    place, motion = np.array(uses.place, np.int64), np.array(uses.motion, np.int64)
    point = rows[np.array(uses.point, np.int64)]
    found = np.stack([place, point, motion], axis=1)[point >= 0]
    found = found[np.argsort(found[:, 0], kind="stable")]
    if np.array_equal(found[:, 1], np.arange((rows >= 0).sum())):
        return np.empty((0, 3), np.int64)
    return np.asarray(found)


def motions_of(point: IntArray, how: IntArray, count: int) -> IntArray:
    """Returns how every point (count,) is moved to: as at first, PTP if it ever is."""
    motion = np.full(count, int(Motion.UNUSED))
    motion[point[::-1]] = how[::-1]
    motion[point[how == Motion.PTP]] = Motion.PTP
    return motion


def firsts(point: IntArray, count: int) -> IntArray:
    """Returns for every point (count,) the first of its uses, -1 if it has none."""
    out = np.full(count, -1, np.int64)
    out[point[::-1]] = np.arange(len(point))[::-1]
    return out
