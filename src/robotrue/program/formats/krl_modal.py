"""Components a KRL target leaves out: the controller keeps those of the target moved to before."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray


class Visits(NamedTuple):
    """Every motion of the main file in the order it is executed.

    Attributes:
        row: (v,) the target moved to, -1 where it is not known what moved the robot.
        via: (v,) it is the auxiliary point of an arc; nothing is inherited from it.
        torn: (v,) its components cannot be taken as written.
    """

    row: IntArray
    via: BoolArray
    torn: BoolArray


def visits(
    inline: Iterable[tuple[int, int, bool]],
    told: Iterable[tuple[int, int, bool]],
    row_of: IntArray,
    torn: BoolArray,
) -> Visits:
    """Returns the visits in order, from (line, aggregate or -1, is auxiliary) entries.

    Args:
        inline: Motions the scanner sorted out.
        told: Motions and breaks the walk found.
        row_of: (a + 1,) row of every aggregate, -1 for those that are no target; the last is -1.
        torn: (n,) rows whose components cannot be taken as written.
    """
    entries = sorted([*inline, *told], key=lambda entry: entry[:2])
    order = np.array(entries, dtype=np.int64).reshape(-1, 3)
    row = np.where(order[:, 1] >= 0, row_of[order[:, 1]], -1)
    return Visits(row, order[:, 2] > 0, (row < 0) | torn[row])


def inherit_external(values: Array, path: Visits) -> None:
    """Fills external axes (n, 6) that targets leave out, in place: an axis stays where it is.

    A target that is moved to twice keeps what it leaves out open.
    """
    moved = path.row >= 0
    once = np.bincount(path.row[moved], minlength=len(values))[path.row] == 1
    for column in np.flatnonzero(np.isnan(values).any(axis=0) & ~np.isnan(values).all(axis=0)):
        said = np.where(moved, values[path.row, column], np.nan)
        told = ~moved | ~np.isnan(said)  # the last move there is unknown, or the value is stated
        last = np.maximum.accumulate(np.where(told, np.arange(len(told)), 0))
        fill = moved & once & np.isnan(said)
        values[path.row[fill], column] = said[last[fill]]


def inherit(
    values: Array, path: Visits, kind: IntArray, state: IntArray
) -> tuple[IntArray, IntArray]:
    """Fills left-out components of ``values`` in place; returns (rows, donors) in path order.

    Nothing is inherited across a break, a change of frame or tool, or from pose to axis targets.

    Args:
        values: (n, 6) as printed, NaN where left out.
        path: The motions in order.
        kind: (n,) 1 for axis targets, 0 for poses.
        state: (n, k) frame and tool in force at each row.
    """
    written = ~np.isnan(values)
    lacking: BoolArray = np.asarray(~written.all(axis=1))
    used = np.bincount(path.row[path.row >= 0], minlength=len(values))
    kept: dict[int, IntArray] = {}
    last, previous = np.full(6, -1, np.int64), -1
    columns, nothing = np.arange(6), np.full(6, -1, np.int64)
    for row, via, torn in zip(*(column.tolist() for column in path), strict=True):
        now = int(kind[row]) if row >= 0 else -1
        if torn or (previous >= 0 and now != previous):
            last = nothing
        previous = now
        if torn:
            continue
        if lacking[row] and used[row] == 1:
            donors = np.where(written[row], -1, last)
            same = (donors >= 0) & (state[donors] == state[row]).all(axis=1)
            kept[row] = donors = np.where(same, donors, -1)
            values[row] = np.where(donors >= 0, values[donors, columns], values[row])
        if not via:
            last = np.where(written[row] | (kept.get(row, nothing) >= 0), row, -1)
    rows = np.array(list(kept), dtype=np.int64)
    return rows, np.array(list(kept.values()), dtype=np.int64).reshape(-1, 6)


def incomplete_notes(name: str, line: IntArray, rows: BoolArray) -> list[str]:
    """Returns the sentence on targets that leave components out, if there are any."""
    at = np.flatnonzero(rows)
    if not len(at):
        return []
    return [
        f"{name}:{line[at[0]]}: {len(at)} targets from this line on leave components out, and "
        "their inherited values are unknown; they are not compensated, but follow the previous "
        "target where it is compensated. Write all six components."
    ]
