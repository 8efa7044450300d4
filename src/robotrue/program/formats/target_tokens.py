"""Six printed numbers per target: their places, their values, and their new values.

For languages that print X, Y, Z in mm and the turns about X, Y and Z in deg, rotation Rz Ry Rx
(Yaskawa's Rx Ry Rz, Fanuc's W P R) or Rx Ry Rz (VAL3), or six axis values. A number is rewritten in
its style, only when it differs by more than half of its last digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG, MM
from robotrue.program.euler import abc_from_matrices, matrices_from_abc
from robotrue.program.formats.number_table import Numbers, put_stretches, respell_tokens
from robotrue.program.formats.number_text import Stretch
from robotrue.program.formats.pose_write import PrintedForm, new_values
from robotrue.program.program import Program, Replacement

LEAST_DECIMALS: Final = 3
"""Of a millimetre or degree that is rewritten: a correction of 0.02 mm would be lost in ``5.0``."""
POSE: Final = 0
"""Kind of a target whose numbers are a pose; kinds above are axis values, each in another unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTokens:
    """Places of the numbers of n targets.

    Attributes:
        start: (n, 6) first byte of each number.
        length: (n, 6) its bytes.
        value: (n, 6) as printed; NaN where there is no number.
        kind: (n,) ``POSE``, or the row of ``unit``.
        unit: (k, 6) rad per printed unit of axis values; row 0 is not used. NaN is not known.
        whole: (k,) axis values are printed without decimals.
        x_first: The rotation is Rx Ry Rz: about X, then the new Y, then the new Z.
    """

    start: IntArray
    length: IntArray
    value: Array
    kind: IntArray
    unit: Array
    whole: BoolArray
    x_first: bool = False

    def take(self, rows: slice) -> TargetTokens:
        """Returns the places of some targets."""
        names = ("start", "length", "value", "kind")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


def values_of(tokens: TargetTokens) -> tuple[Array, Array, Array]:
    """Returns position (n, 3) m, rotation (n, 3, 3) and axes (n, 6) rad, NaN where not given."""
    pose = (tokens.kind == POSE)[:, None]
    printed = np.where(pose, tokens.value, np.nan)
    axes = np.where(pose, np.nan, tokens.value * tokens.unit[tokens.kind])
    # Rx(a) Ry(b) Rz(c) is the transpose of Rz(-c) Ry(-b) Rx(-a).
    turns = printed[:, :2:-1] * (-1.0 if tokens.x_first else 1.0)
    rotation = matrices_from_abc(np.ascontiguousarray(turns), DEG)
    if tokens.x_first:
        rotation = np.ascontiguousarray(rotation.transpose(0, 2, 1))
    return printed[:, :3] * MM, rotation, axes


def rewritten(
    program: Program,
    replacement: Replacement,
    tokens: TargetTokens,
    others: Sequence[Stretch],
    *,
    aligned: bool,
) -> bytes:
    """Returns the bytes with the numbers that change, and other stretches, replaced.

    Args:
        program: As it was read.
        replacement: What its targets shall be.
        tokens: Places of its numbers.
        others: Other stretches, clear of the numbers.
        aligned: A number after two or more blanks keeps its column where they allow it.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm, deg or pulses.
    """
    values, touched = new_values(
        program, replacement, tokens.value, tokens.kind != POSE, _form_of(tokens)
    )
    touched &= tokens.length > 0
    data, start = put_stretches(program.data, others, tokens.start)
    least = np.where(tokens.whole[tokens.kind] & (tokens.kind != POSE), 0, LEAST_DECIMALS)
    least = np.broadcast_to(least[:, None], values.shape)
    numbers = Numbers(start=start, length=tokens.length, value=tokens.value)
    return respell_tokens(data, numbers, values, touched, least, least, aligned=aligned)


def _form_of(tokens: TargetTokens) -> PrintedForm:
    """How these targets are printed."""
    sign = -1.0 if tokens.x_first else 1.0

    def turn(rotation: Array, printed: Array) -> Array:
        near = np.ascontiguousarray(printed[:, ::-1]) * (sign * DEG)
        turned = rotation.transpose(0, 2, 1) if tokens.x_first else rotation
        abc = abc_from_matrices(np.ascontiguousarray(turned), near)
        return abc[:, ::-1] * (sign / DEG)

    axis = tokens.unit[tokens.kind]
    return PrintedForm(length=MM, turns=3, turn=turn, axis=axis, unit="mm, deg or pulses")
