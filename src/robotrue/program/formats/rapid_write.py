"""Puts new numbers into the bytes of a RAPID module; every other byte is copied.

Millimetres and degrees with fewer than three decimals are rewritten with four, quaternions with
fewer than six with eight, so that a correction is not rounded away; all else keeps its style
(:mod:`robotrue.program.formats.number_text`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.formats.number_table import Numbers, put_stretches, respell_tokens
from robotrue.program.formats.path_kernels import decimals_of
from robotrue.program.formats.pose_write import PrintedForm, changed_rows, new_values, spans_of
from robotrue.program.formats.written_out import NONE_WRITTEN, WrittenOut
from robotrue.program.program import Program, Replacement

_ENOUGH: Final = np.array([3] * 3 + [6] * 4 + [0] * 10)
_LEAST: Final = np.array([4] * 3 + [8] * 4 + [0] * 10)
_WRITTEN: Final = np.array([4] * 3 + [9] * 4 + [4] * 10)
_MOST: Final = np.array([9] * 3 + [12] * 4 + [9] * 10)
"""Decimals of what is written out: as many as the module has, within these."""
_NOT_CONNECTED: Final = 8.9e9
"""Beyond, an external axis is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RapidSpans:
    """Where the numbers of the targets stand.

    Attributes:
        numbers: (n, 17) x, y, z, q1..q4, cf1, cf4, cf6, cfx, external axes; of axis targets the
            axes in the first six columns.
        is_axis: (n,) the target is a jointtarget.
        written: Rows that are written out.
        bound: (w,) they are written out with every change of the file.
    """

    numbers: Numbers
    is_axis: BoolArray
    written: WrittenOut = NONE_WRITTEN
    bound: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))


def write_rapid(program: Program, replacement: Replacement) -> bytes:
    """Returns the module with the numbers of the changed rows replaced and nothing else touched.

    Of the two quaternions of an orientation the one with the sign of the old is written.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    spans = spans_of(program, RapidSpans, "rapid")
    values, touched = new_values(program, replacement, spans.numbers.value, spans.is_axis, _FORM)
    told = np.asarray(replacement.words, dtype=np.int64)
    pose = changed_rows(program, replacement) & ~spans.is_axis
    touched[:, 7:11] = (told != NO_WORD) & pose[:, None]
    values[:, 7:11] = np.where(touched[:, 7:11], told, values[:, 7:11])
    data, numbers = program.data, spans.numbers
    moves = (touched & (values != numbers.value)).any(axis=1)
    chosen = np.flatnonzero(moves[spans.written.row] | (spans.bound & moves.any()))
    if len(chosen):
        rows = spans.written.row[chosen].tolist()
        have = decimals_of(np.frombuffer(data, np.uint8), numbers.start, numbers.length)
        decimals = np.clip(have.max(axis=0), _WRITTEN, _MOST).tolist()
        texts = [_literal(values[row], decimals, axis=bool(spans.is_axis[row])) for row in rows]
        stretches = spans.written.stretches(chosen.tolist(), texts)
        data, start = put_stretches(data, stretches, numbers.start)
        numbers = replace(numbers, start=start)
    is_axis = spans.is_axis[:, None]
    enough, least = np.where(is_axis, 3, _ENOUGH), np.where(is_axis, 4, _LEAST)
    return respell_tokens(data, numbers, values, touched, enough, least)


def _literal(values: Array, decimals: list[int], *, axis: bool) -> bytes:
    """Returns a target in brackets from its row of numbers and their decimals."""
    shown = [_print(value, most) for value, most in zip(values.tolist(), decimals, strict=True)]

    def row(first: int, last: int) -> str:
        return "[" + ",".join(shown[first:last]) + "]"

    if axis:
        parts = [row(0, 6), row(11, 17)]
    else:
        words = "[" + ",".join(str(int(value)) for value in values[7:11]) + "]"
        parts = [row(0, 3), row(3, 7), words, row(11, 17)]
    return ("[" + ",".join(parts) + "]").encode("ascii")


def _print(value: float, decimals: int) -> str:
    return "9E9" if value > _NOT_CONNECTED else f"{value + 0.0:.{decimals}f}"


def _choose_sides(rotation: Array, old: Array) -> Array:
    """Returns unit quaternions (k, 4) on the side of the old ones."""
    new = quat_wxyz_from_matrix(rotation)
    sign = np.where(np.sum(new * old, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    out: Array = sign * new
    return out


_FORM: Final = PrintedForm(
    length=MM, turns=4, turn=_choose_sides, axis=DEG, unit="mm, quaternion or deg"
)
