"""Dense columns of KRL targets, from the tokens of a scanned file."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray, Ints
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.units import DEG, MM
from robotrue.program.euler import matrices_from_abc
from robotrue.program.formats.krl_scan import AXIS, COMPONENTS, EXTERNAL, STATUS, Scan
from robotrue.program.formats.krl_write import column_of
from robotrue.program.formats.number_table import Numbers


def target_numbers(found: Scan, agg: IntArray) -> tuple[Numbers, BoolArray, BoolArray]:
    """Returns the places of the numbers of targets, as in :class:`KrlSpans`, in mm and deg.

    Beside them is pose (n,) and is axis (n,): which of both kinds a target has.
    """
    component = found.tok_component
    any_external = len(agg) and ((component >= EXTERNAL) & (component < STATUS)).any()
    shape = len(agg), 14 if any_external else 8
    start, length = np.full(shape, -1), np.zeros(shape, np.int64)
    value = np.full(shape, np.nan)
    kinds = np.zeros((2, len(agg)), np.bool_)
    token = found.agg_token[agg], found.agg_token[agg + 1]
    columns = np.array([column_of(code) for code in range(len(COMPONENTS))])
    _gather(
        *token, component, found.tok_start, found.tok_length, found.tok_value, columns, start,
        length, value, kinds,
    )  # fmt: skip
    return Numbers(start=start, length=length, value=value), kinds[0], kinds[1]


def count_parts(found: Scan) -> tuple[IntArray, IntArray]:
    """Returns how many pose and how many axis components each aggregate (a,) has."""
    component = found.tok_component
    is_axis = (component >= AXIS) & (component < EXTERNAL)
    pose, axis = (
        np.diff(np.concatenate([[0], np.cumsum(one)])[found.agg_token])
        for one in (component < AXIS, is_axis)
    )
    return pose, axis


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
    token: Ints,
    end: Ints,
    component: Bytes,
    begun: Ints,
    size: npt.NDArray[np.uint16],
    said: Array,
    columns: IntArray,
    start: IntArray,
    length: IntArray,
    value: Array,
    kinds: BoolArray,
) -> None:
    """Fills the tables (n, w) from the tokens of every row."""
    for row in range(token.size):
        for t in range(token[row], end[row]):
            code = component[t]
            if code < EXTERNAL:
                kinds[code // 6, row] = True
            column = columns[code]
            value[row, column] = said[t]
            if size[t] > 0:
                start[row, column], length[row, column] = begun[t], size[t]
