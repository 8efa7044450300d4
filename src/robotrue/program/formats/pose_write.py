"""What changed targets shall say, checked, for languages whose numbers stand in a table."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ShapeError
from robotrue.program.program import Program, Replacement

_SAME_POSITION: Final = 1e-11
"""m; coordinates nearer than this to the ones read are the ones read."""
SAME_ROTATION: Final = 1e-10
"""Largest difference of a matrix element, or rad of an axis, that counts as unchanged."""
_LARGEST: Final = 1e9


def changed_rows(program: Program, replacement: Replacement) -> BoolArray:
    """Returns the rows to rewrite (n,).

    Raises:
        ShapeError: Of another length than the program.
    """
    changed = np.asarray(replacement.changed, dtype=np.bool_)
    if changed.shape != (len(program),):
        raise ShapeError(f"changed has shape {changed.shape}, expected ({len(program)},).")
    return changed


def find_moved(
    program: Program, replacement: Replacement
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Returns which coordinates (n, 3), orientations (n,) and axes (n, dof) are not as read.

    What is not finite in the replacement counts as moved, so that it is refused and not passed by.
    """
    with np.errstate(invalid="ignore"):
        place = ~(np.abs(replacement.position - program.position) <= _SAME_POSITION)
        turn = ~(np.abs(replacement.rotation - program.rotation) <= SAME_ROTATION).all(axis=(1, 2))
        axes = ~(np.abs(replacement.axes - program.axes) <= SAME_ROTATION)
    return place, np.asarray(turn, dtype=np.bool_), axes


def require_printable(program: Program, values: Array, touched: BoolArray, unit: str) -> None:
    """Refuses values that no controller reads.

    Raises:
        ShapeError: A touched value is not finite, or not below 1e9, with its line.
    """
    bad = touched & ~(np.abs(values) < _LARGEST)
    if bad.any():
        at = int(np.argwhere(bad)[0][0])
        raise ShapeError(
            f"the new target is {values[at].tolist()} ({unit}), expected finite numbers below 1e9.",
            source=program.name,
            line=int(program.line[at]),
            hint="leave this row unchanged.",
        )
