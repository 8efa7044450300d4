"""Writes new numbers into the bytes of a UR script; every other byte is copied.

Metres and radians with fewer than six decimals are rewritten with seven (0.1 um); all else keeps
its style (:mod:`robotrue.program.formats.number_text`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.program.formats.pose_write import PrintedForm, spans_of
from robotrue.program.formats.written_out import TableSpans, TargetForm, write_table
from robotrue.program.program import Program, Replacement


def write_urscript(program: Program, replacement: Replacement) -> bytes:
    """Returns the script with the numbers of the changed rows replaced and nothing else touched.

    The numbers are x, y, z in m and the rotation vector in rad, or six axes in rad.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 m or rad.
    """
    return write_table(program, replacement, spans_of(program, TableSpans, "urscript"), _FORM)


def nearest_rotation_vector(rotation: Array, near: Array) -> Array:
    """Returns the rotation vectors (k, 3) rad of (k, 3, 3) that are nearest to ``near`` (k, 3).

    A vector and the one a full turn shorter or longer are the same rotation: near half a turn a
    correction of 0.01 deg may otherwise print the opposite vector.
    """
    if not np.isfinite(rotation).all():
        return np.full((len(rotation), 3), np.nan)
    vector = rotation_vector_from_matrix(rotation)
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    near_length = np.linalg.norm(near, axis=1, keepdims=True)
    tiny = 1e-12
    # No turn at all is a full turn about any axis: the printed one.
    axis = np.where(
        length > 1e-7, vector / np.maximum(length, tiny), near / np.maximum(near_length, tiny)
    )
    turns = np.rint((np.sum(axis * near, axis=1, keepdims=True) - length) / (2.0 * np.pi))
    out: Array = vector + 2.0 * np.pi * turns * axis
    return out


_FORM: Final = TargetForm(
    printed=PrintedForm(length=1.0, turns=3, turn=nearest_rotation_vector, axis=1.0, unit="m, rad"),
    enough=np.full((2, 6), 6),
    least=np.full((2, 6), 7),
)
