"""Rows of arcs: a middle before every end, in a plane or through a point that is written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.program.formats.apt_arcs import MISS
from robotrue.program.formats.gcode_arcs import (
    ACROSS,
    Centre,
    PlaneArcs,
    in_plane,
    middles,
    no_arcs,
)
from robotrue.program.formats.gcode_state import Rows, Words
from robotrue.program.formats.gcode_vocabulary import Drive, Modal, WordColumn
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.path_words import Turn
from robotrue.program.program import Motion, Reason

G = TypeVar("G", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """m blocks as n rows: an arc has two.

    Attributes:
        count: n.
        source: (n,) block of every row.
        place: (m,) row of every block: the end of an arc.
    """

    count: int
    source: IntArray
    place: IntArray

    def rows_of(self, column: npt.NDArray[G]) -> npt.NDArray[G]:
        """Returns a column of blocks (m, ...) as one of rows (n, ...)."""
        return column[self.source]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArcRows:
    """The arcs of a program.

    Attributes:
        spread: Blocks as rows.
        ends: (a,) rows of the ends of all arcs, their middles right before them.
        starts: (a,) rows they begin at, -1 where that is not certain.
        loose: (a,) the arc's words stay valid when its start moves.
        closed: (a,) whole circles, also as a helix: they end where they begin.
        bad: (m,) blocks whose arc is not determined.
        plane: Those with a centre or a radius that can be rewritten.
        through: (a,) rows of middles that are written, and their words.
        middle: Middles of the plane arcs (k, 3), as printed.
    """

    spread: Spread
    ends: IntArray
    starts: IntArray
    loose: BoolArray
    closed: BoolArray
    bad: BoolArray
    plane: PlaneArcs
    through: tuple[IntArray, Numbers]
    middle: Array

    @property
    def skip(self) -> BoolArray:
        """(n,) middles."""
        out = np.zeros(self.spread.count, np.bool_)
        out[self.ends - 1] = True
        return out

    def numbers(self, point: Numbers) -> Numbers:
        """Returns the words (n, 6) of all rows from those of blocks (m, 6)."""
        source = np.where(self.skip, -1, self.spread.source)
        out = point.rows(source)
        rows, words = self.through
        start, length, value = np.array(out.start), np.array(out.length), np.array(out.value)
        start[rows, :3], length[rows, :3], value[rows, :3] = words.start, words.length, words.value
        return Numbers(start=start, length=length, value=value)

    def fill(self, value: Array) -> None:
        """Writes the middles into values (n, 6) as printed."""
        rows, words = self.through
        value[rows, :3] = words.value
        value[self.plane.via, :3] = self.middle
        bare = np.setdiff1d(self.ends - 1, np.concatenate([rows, self.plane.via]))
        value[bare, :3] = np.nan

    def turn_middles(self, rotation: Array) -> None:
        """Gives middles (n, 3, 3) the orientation half way, where the start is certain."""
        known = self.starts >= 0
        first, last = rotation[self.starts[known]], rotation[self.ends[known]]
        fine = np.isfinite(first + last).all(axis=(1, 2))
        first, last = first[fine], last[fine]
        turn = rotation_vector_from_matrix(np.swapaxes(first, 1, 2) @ last)
        half = first @ matrix_from_rotation_vector(0.5 * turn)
        rotation[self.ends[known][fine] - 1] = half

    def motion(self, plain: IntArray) -> IntArray:
        """Returns :class:`Motion` (n,) from that of blocks (m,)."""
        out = np.array(plain[self.spread.source])
        out[self.ends - 1], out[self.ends] = Motion.ARC_VIA, Motion.ARC_END
        return out

    def behind(self, at: IntArray) -> IntArray:
        """Returns where words can be inserted (n,) from those of blocks (m,)."""
        out = np.array(at[self.spread.source])
        out[self.ends - 1] = -1
        return out

    def groups(self, reason: IntArray) -> list[list[int]]:
        """Returns rows that share their fate.

        Of a whole circle, and of an arc that cannot be rewritten, the start is one of them.
        """
        out = []
        stays = (reason[self.ends] != Reason.NONE) | (reason[self.ends - 1] != Reason.NONE)
        stiff = (((stays & ~self.loose) | self.closed) & (self.starts >= 0)).tolist()
        for end, start, joins in zip(self.ends.tolist(), self.starts.tolist(), stiff, strict=True):
            out.append([start, end - 1, end] if joins else [end - 1, end])
        return out


def arc_rows(rows: Rows, words: Words, base: IntArray, *, absolute: bool) -> ArcRows:
    """Returns the arcs of a program.

    Args:
        rows: Blocks that go somewhere.
        words: Their words.
        base: (m,) work frame of each.
        absolute: I, J, K are coordinates of the centre.
    """
    m, drive = len(rows.block), rows.force[:, Modal.MOTION]
    relative = rows.force[:, Modal.RELATIVE] != 0
    round_ = np.isin(drive, (Drive.RIGHT, Drive.LEFT, Drive.THROUGH)) & (rows.turn != Turn.AXES)
    arc = np.flatnonzero(round_)
    source = np.repeat(np.arange(m), 1 + round_)
    place = np.arange(m) + np.cumsum(round_)
    spread = Spread(count=len(source), source=source, place=place)
    before = np.maximum(arc - 1, 0)
    sure = (arc > 0) & (rows.epoch[arc] == rows.epoch[before]) & (base[arc] == base[before])
    sure &= np.isfinite(rows.value[before, :3]).all(axis=1) & ~relative[arc] & ~relative[before]
    starts = np.where(sure, place[before], -1)
    through, by_point = words.numbers((WordColumn.VX, WordColumn.VY, WordColumn.VZ))
    whole = np.asarray(by_point.all(axis=1))[arc] & ~relative[arc]
    plane = _plane_arcs(rows, words, arc, place, starts, absolute, by_point)
    value = rows.value[source, :3]
    if len(plane):
        middle, miss = middles(plane, value)
        fine = np.isfinite(middle).all(axis=1)
        fine &= miss * rows.unit[source[plane.end]] <= MISS
        plane, middle = _pick_arcs(plane, fine), middle[fine]
    else:
        plane, middle = no_arcs(), np.empty((0, 3))
    told = whole | np.isin(place[arc], plane.end)
    bad = np.zeros(m, np.bool_)
    bad[arc[~told]] = True
    chosen = arc[whole]
    # A conversational arc takes no third axis: it cannot state its previous end.
    loose = told & np.asarray(not absolute)
    way = in_plane(np.maximum(rows.force[arc, Modal.PLANE], 0), value[place[arc]] - value[starts])
    closed = (starts >= 0) & (way == 0.0).all(axis=1)
    return ArcRows(
        spread=spread, ends=place[arc], starts=starts, loose=loose, closed=closed, bad=bad,
        plane=plane,
        through=(place[chosen] - 1, through.rows(chosen)), middle=middle,
    )  # fmt: skip


def _plane_arcs(
    rows: Rows,
    words: Words,
    arc: IntArray,
    place: IntArray,
    starts: IntArray,
    absolute: bool,
    by_point: BoolArray,
) -> PlaneArcs:
    """Arcs whose words are a centre in their plane or a radius, and nothing else."""
    centre, there = words.numbers((WordColumn.I, WordColumn.J, WordColumn.K))
    radius, by_radius = words.numbers((WordColumn.R,))
    plane = np.maximum(rows.force[:, Modal.PLANE], 0)
    across = ACROSS[plane]
    aside = np.take_along_axis(there, across[:, 2:], axis=1)[:, 0]
    aside &= np.take_along_axis(np.nan_to_num(centre.value), across[:, 2:], axis=1)[:, 0] != 0.0
    flat = np.take_along_axis(there, across[:, :2], axis=1).any(axis=1)
    drive = rows.force[:, Modal.MOTION]
    fit = np.isin(drive, (Drive.RIGHT, Drive.LEFT)) & ~by_point.any(axis=1) & ~aside
    fit &= flat ^ by_radius[:, 0]
    computed = (there & (centre.start < 0)).any(axis=1) | (by_radius & (radius.start < 0)).any(
        axis=1
    )
    full_way = np.take_along_axis(there, across[:, :2], axis=1).all(axis=1)
    by_centre = rows.force[:, Modal.CENTRE] == 1 if not absolute else np.ones(len(fit), np.bool_)
    fit &= ~computed & (full_way | ~by_centre | by_radius[:, 0])
    fit &= rows.force[:, Modal.PLANE] >= 0
    keep = fit[arc] & (starts >= 0)
    arc, starts = arc[keep], starts[keep]
    by_r = by_radius[arc, 0]
    wide = Numbers(
        start=np.pad(radius.start, ((0, 0), (0, 2)), constant_values=-1),
        length=np.pad(radius.length, ((0, 0), (0, 2))),
        value=np.pad(radius.value, ((0, 0), (0, 2)), constant_values=np.nan),
    ).rows(arc)
    own = centre.rows(arc)
    numbers = Numbers(
        start=np.where(by_r[:, None], wide.start, own.start),
        length=np.where(by_r[:, None], wide.length, own.length),
        value=np.where(by_r[:, None], wide.value, own.value),
    )
    kind = np.where(
        by_r, Centre.RADIUS, np.where(by_centre[arc], Centre.ABSOLUTE, Centre.FROM_START)
    )
    return PlaneArcs(
        start=starts, via=place[arc] - 1, end=place[arc], kind=kind.astype(np.int64),
        plane=plane[arc], left=drive[arc] == Drive.LEFT, numbers=numbers,
        value=np.nan_to_num(numbers.value),
    )  # fmt: skip


def _pick_arcs(arcs: PlaneArcs, keep: BoolArray) -> PlaneArcs:
    numbers = arcs.numbers.rows(np.flatnonzero(keep))
    return PlaneArcs(
        start=arcs.start[keep], via=arcs.via[keep], end=arcs.end[keep], kind=arcs.kind[keep],
        plane=arcs.plane[keep], left=arcs.left[keep], numbers=numbers, value=arcs.value[keep],
    )  # fmt: skip
