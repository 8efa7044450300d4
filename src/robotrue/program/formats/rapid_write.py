"""Writes new numbers into the bytes of a RAPID module; every other byte is copied.

Millimetres and degrees with fewer than three decimals are rewritten with four, quaternions with
fewer than six with eight, so that a correction is not rounded away; all else keeps its style
(:mod:`robotrue.program.formats.number_text`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.formats.path_kernels import decimals_of
from robotrue.program.formats.pose_write import PrintedForm, spans_of
from robotrue.program.formats.written_out import TableSpans, TargetForm, write_table
from robotrue.program.program import Program, Replacement

_FEWEST: Final = np.array([4] * 3 + [9] * 4 + [4] * 10)
_MOST: Final = np.array([9] * 3 + [12] * 4 + [9] * 10)
"""Decimals of what is written out."""
_NOT_CONNECTED: Final = 8.9e9
"""Beyond, an external axis is absent."""


def write_rapid(program: Program, replacement: Replacement) -> bytes:
    """Returns the module with the numbers of the changed rows replaced and nothing else touched.

    The 17 numbers are x, y, z, q1..q4, cf1, cf4, cf6, cfx and external axes, those of axis targets
    the axes in the first six columns and external axes. Of the two quaternions of an orientation
    the one with the sign of the old is written.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    return write_table(program, replacement, spans_of(program, TableSpans, "rapid"), _FORM)


def _count_decimals(program: Program) -> tuple[list[int], list[int]]:
    """Returns as many decimals as the module has, within bounds."""
    numbers = program.spans.numbers
    have = decimals_of(np.frombuffer(program.data, np.uint8), numbers.start, numbers.length)
    decimals = np.clip(have.max(axis=0), _FEWEST, _MOST).tolist()
    return decimals, decimals


def _print_target(
    values: Array, decimals: list[int], columns: tuple[int, ...], *, axis: bool
) -> bytes:
    """Returns a target in brackets."""
    shown = [
        "9E9" if k > 10 and value > _NOT_CONNECTED else f"{value + 0.0:.{most}f}"
        for k, (value, most) in enumerate(zip(values.tolist(), decimals, strict=True))
    ]

    def row(first: int, last: int) -> str:
        return "[" + ",".join(shown[first:last]) + "]"

    if axis:
        parts = [row(0, 6), row(11, 17)]
    else:
        words = "[" + ",".join(str(int(value)) for value in values[7:11]) + "]"
        parts = [row(0, 3), row(3, 7), words, row(11, 17)]
    return ("[" + ",".join(parts) + "]").encode("ascii")


def _choose_sides(rotation: Array, old: Array) -> Array:
    """Returns unit quaternions (k, 4) on the side of the old ones."""
    new = quat_wxyz_from_matrix(rotation)
    sign = np.where(np.sum(new * old, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    out: Array = sign * new
    return out


_FORM: Final = TargetForm(
    printed=PrintedForm(
        length=MM, turns=4, turn=_choose_sides, axis=DEG, unit="mm, quaternion or deg"
    ),
    enough=np.array([[3] * 3 + [6] * 4 + [0] * 10, [3] * 17]),
    least=np.array([[4] * 3 + [8] * 4 + [0] * 10, [4] * 17]),
    words=slice(7, 11),
    count_decimals=_count_decimals,
    print_target=_print_target,
)
