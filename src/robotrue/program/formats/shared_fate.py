"""Targets that share a fate: of an arc, half of which corrected is another, or of a lost frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.program import Reason

_OPEN: Final = (int(Reason.NONE), int(Reason.JOINT_TARGET))
"""Reasons of targets that may be compensated."""


def share_fate(reason: IntArray, groups: Sequence[Sequence[int]]) -> None:
    """Gives all rows of every group a reason not to be compensated if one of them has one.

    Poses and axis targets in one group count as such a reason, ``INCOMPLETE``, because axis targets
    are compensated on request only. Groups may share rows.

    Args:
        reason: (n,) :class:`Reason`, changed in place.
        groups: Rows of each group.
    """
    value, ordered, changed = reason.tolist(), list(groups), True
    while changed:
        changed = False
        for rows in ordered:
            if len({value[row] for row in rows}) < 2:
                continue
            fresh = [row for row in rows if value[row] in _OPEN]
            closed = next((value[row] for row in rows if value[row] not in _OPEN), None)
            for row in fresh:
                value[row] = int(Reason.INCOMPLETE) if closed is None else closed
            changed |= bool(fresh)
        ordered.reverse()  # a chain of arcs is through in two rounds
    reason[:] = value


def pair_arcs(reason: IntArray, arcs: Sequence[tuple[int, int]]) -> None:
    """Gives both points of every arc, in place, the reason of the one that has any."""
    changed = True
    while changed:
        changed = False
        for via, last in arcs:
            worst = int(reason[via] or reason[last])
            for point in (via, last):
                changed |= bool(worst and not reason[point])
                reason[point] = reason[point] or worst


def flag_lost_frames(
    reason: IntArray,
    columns: Mapping[str, IntArray],
    is_axis: BoolArray,
    lost: Mapping[tuple[str, int], str],
) -> list[str]:
    """Flags targets whose tool or work frame is not known; returns the sentences on those.

    Args:
        reason: (n,) :class:`Reason`, changed in place.
        columns: (n,) index by side, ``tool`` and ``base``.
        is_axis: (n,) targets that need no work frame.
        lost: By side and index the sentence on what is not known.
    """
    out: list[str] = []
    for side, column in columns.items():
        rows = np.isin(column, [index for which, index in lost if which == side])
        if side == "base":
            rows &= ~is_axis
        reason[rows] = Reason.UNKNOWN_FRAME
        out += [lost[side, index] for index in np.unique(column[rows]).tolist()]
    return out
