"""Dense columns of KRL targets, from the tokens of a scanned file."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, Integers
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.units import DEG, MM
from robotrue.program.euler import matrices_from_abc
from robotrue.program.formats.krl_scan import STATUS, Scan


def target_columns(
    found: Scan, agg: IntArray
) -> tuple[Array, Array | None, IntArray, BoolArray, BoolArray]:
    """Returns values (n, 6) in mm and deg, external axes if any, S and T, is pose, is axis."""
    n = len(agg)
    values = np.full((n, 6), np.nan)
    any_external = bool((found.tok_component >= 12).any()) and n > 0
    external = np.full((n if any_external else 1, 6), np.nan)
    any_words = bool((found.tok_component >= STATUS).any())
    words = np.full((n if any_words else 1, 2), -1, np.int64)
    pose, axis = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    token, end = found.agg_token[agg], found.agg_token[agg + 1]
    _gather(token, end, found.tok_component, found.tok_value, values, external, words, pose, axis)
    words = np.broadcast_to(words, (n, 2))
    return values, (external if any_external else None), words, pose, axis


def lean(column: IntArray) -> IntArray:
    """Returns a column read-only, and as one row seen n times where all rows are the same."""
    alike = len(column) > 1 and bool((column == column[0]).all())
    out = np.broadcast_to(np.array(column[:1]), column.shape) if alike else column.copy()
    out.flags.writeable = False
    return out


def si_columns(values: Array, axis: BoolArray) -> tuple[Array, Array, Array]:
    """Returns position, rotation and axes in m and rad, read-only, from (n, 6) in mm and deg."""
    position = values[:, :3] * MM
    rotation = matrices_from_abc(values[:, 3:], DEG)
    axes: Array = np.broadcast_to(np.nan, (len(values), 6))
    if axis.any():
        position[axis], rotation[axis] = np.nan, np.nan
        axes = np.where(axis[:, None], values * DEG, np.nan)
    for array in (position, rotation, axes):
        array.flags.writeable = False
    return position, rotation, axes


@compile_kernel(PLAIN)
def _gather(
    token: Integers,
    end: Integers,
    component: Integers,
    value: Array,
    values: Array,
    external: Array,
    words: Integers,
    pose: BoolArray,
    axis: BoolArray,
) -> None:
    """Fills the dense columns of every row from its tokens."""
    for row in range(token.size):
        for t in range(token[row], end[row]):
            code = component[t]
            if code < 12:
                values[row, code % 6] = value[t]
                if code < 6:
                    pose[row] = True
                else:
                    axis[row] = True
            elif code < 18:
                external[row, code - 12] = value[t]
            else:
                words[row, code - 18] = int(value[t])
