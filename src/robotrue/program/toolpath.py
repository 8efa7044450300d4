"""A tool path as CAM systems write it: the tool tip on the part, independent of a robot.

Positions and tool axes are in the part frame (the frame the CAM system printed them in). A tool
axis has five degrees of freedom with its point; the robot's spin about it is chosen later
(:mod:`robotrue.planning.tool_axis`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ShapeError

_UNIT: Final = 1e-9
"""By which a tool axis may miss length 1; readers normalise what files print."""
LARGEST: Final = 20.0
"""m; a part larger than this is in another unit."""
FASTEST: Final = 3.0
"""m/s; no arm cuts or flies faster, a number beyond is in another unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """A statement of the file that moves nothing: spindle, coolant, an unknown word.

    Attributes:
        before: Index of the point after it.
        line: One-based line.
        text: As written, blanks collapsed.
        known: Its meaning is known and handled; others are for the user to read.
    """

    before: int
    line: int
    text: str
    known: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Toolpath(Columns):
    """n points in the order they are cut, in the part frame.

    Attributes:
        name: Of the side or operation the path belongs to; by default that of its file.
        source: File it was read from.
        position: (n, 3) m, tool tip.
        axis: (n, 3) unit vectors from the tip to the spindle.
        feed: (n,) m/s of the move to each point; NaN where the file states none.
        rapid: (n,) the move to the point cuts nothing.
        line: (n,) one-based line each point comes from; points of an arc share theirs.
        operation: (n,) index into ``operations``.
        operations: Names the file gives its operations, in order.
        tools: (name, line) of the tools the file loads, in order.
        remarks: Statements kept for the program, in order.
        notes: What the user should know, one sentence each, with line numbers.
    """

    name: str
    source: str
    position: Annotated[Array, Column("n 3", unit="m")]
    axis: Annotated[Array, Column("n 3")]
    feed: Annotated[Array, Column("n", unit="m/s", nan=True)]
    rapid: Annotated[BoolArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    operation: Annotated[IntArray, Column("n")]
    operations: tuple[str, ...]
    tools: tuple[tuple[str, int], ...] = ()
    remarks: tuple[Remark, ...] = ()
    notes: tuple[str, ...] = ()

    def _check_rules(self) -> None:
        """Points there are, unit axes, names of all operations, and a size that parts have."""
        if not len(self):
            raise ImplausibleDataError("the tool path has no point.", source=self.source)
        bad = np.flatnonzero(np.abs(np.linalg.norm(self.axis, axis=1) - 1.0) > _UNIT)
        if len(bad):
            raise ShapeError(f"axis[{bad[0]}] is not a unit vector.")
        if self.operation.min() < 0 or self.operation.max() >= len(self.operations):
            raise ShapeError(f"operation has indices beyond the {len(self.operations)} names.")
        extent = np.ptp(self.position, axis=0).max()
        if extent > LARGEST:
            raise ImplausibleDataError(
                f"the tool path is {extent:.1f} m long, at most {LARGEST:g} m are expected.",
                source=self.source,
                hint="check its unit, UNITS/MM or UNITS/INCHES.",
            )

    def __len__(self) -> int:
        return len(self.position)

    @property
    def cutting(self) -> BoolArray:
        """(n,) points reached by a move that cuts."""
        return np.asarray(~self.rapid)

    def place(self, index: int) -> str:
        """Returns ``file:line`` of a point, for messages."""
        return f"{self.source}:{self.line[index]}"

    def with_points(
        self, pick: IntArray, *, position: Array, rapid: BoolArray, notes: Iterable[str] = ()
    ) -> Toolpath:
        """Returns the path with another list of points; other values come from an old point each.

        Args:
            pick: (m,) index of the old point each new one takes axis, feed, line and operation of.
            position: (m, 3) m.
            rapid: (m,).
            notes: Added to those of the path.
        """
        pick = np.asarray(pick, dtype=np.int64)
        first = {int(old): new for new, old in reversed(list(enumerate(pick)))}
        later = np.array(sorted(first), dtype=np.int64)
        remarks = []
        for remark in self.remarks:
            at = int(np.searchsorted(later, remark.before))
            before = first[int(later[at])] if at < len(later) else len(pick)
            remarks.append(replace(remark, before=before))
        return replace(
            self,
            position=position,
            rapid=rapid,
            axis=self.axis[pick],
            feed=self.feed[pick],
            line=self.line[pick],
            operation=self.operation[pick],
            remarks=tuple(remarks),
            notes=(*self.notes, *notes),
        )


def leave_stock(path: Toolpath, stock: float) -> Toolpath:
    """Returns the path raised by ``stock`` m along the tool axis of each point that cuts."""
    shift = np.where(path.rapid, 0.0, stock)[:, None] * path.axis
    every = np.arange(len(path))
    return path.with_points(every, position=path.position + shift, rapid=path.rapid)


def cut_length(path: Toolpath) -> float:
    """Returns the length in m of the moves that cut."""
    steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    return float(steps[path.cutting[1:]].sum())


def duration(path: Toolpath, *, rapid: float, feed: float = np.nan) -> float:
    """Returns the time in s of all moves at their speeds, without acceleration.

    Args:
        path: The path.
        rapid: m/s of rapid moves.
        feed: m/s of moves that cut before any feed is stated.
    """
    steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    speed = np.where(path.rapid, rapid, np.where(np.isnan(path.feed), feed, path.feed))
    return float((steps / speed[1:]).sum())


def summary(path: Toolpath) -> str:
    """Returns one sentence on the path: points, length cut, lifts, feeds."""
    feeds = path.feed[path.cutting & np.isfinite(path.feed)]
    speed = "no feed stated"
    if len(feeds):
        low, high = feeds.min() / MM, feeds.max() / MM
        speed = f"feed {low:g} to {high:g} mm/s" if low < high else f"feed {low:g} mm/s"
    return (
        f"{path.name}: {len(path)} points, {cut_length(path):.3f} m cut, "
        f"{int(path.rapid.sum())} rapid, {speed}"
    )
