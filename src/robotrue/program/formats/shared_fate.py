"""Points that are compensated together or not at all: half a corrected arc is another arc."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from robotrue.core.arrays import IntArray
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
