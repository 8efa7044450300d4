"""Points of a path as words: three coordinates and a printed or modal orientation.

For languages that print a point as X, Y, Z and either three angles, a tool axis, or nothing more,
and leave out what stays the same: G-code, APT, CSV. What is inherited is resolved by the reader.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG
from robotrue.program.euler import abc_from_matrices, matrices_from_abc
from robotrue.program.formats.gcode_arcs import PlaneArcs
from robotrue.program.formats.number_table import Numbers
from robotrue.program.orientation import OrientationRule

AXIS_MISS: Final = 0.01
"""By which the length of a printed tool axis may miss 1."""


class Turn(IntEnum):
    """Forms of a point's orientation."""

    FIXED = 0  # not in the program: a tool axis that stays
    ANGLES = 1
    VECTOR = 2  # tool axis, tip to spindle
    AXES = 3  # no point at all: six axis values


@dataclass(frozen=True, slots=True, kw_only=True)
class PathWords:
    """Places and values of the words of n points.

    Attributes:
        numbers: (n, 6) X, Y, Z and orientation, or six axis values; as printed.
        value: (n, 6) the same with what is inherited, NaN where it is not known.
        unit: (n,) m per printed length.
        turn: (n,) :class:`Turn`.
        skip: (n,) auxiliary points of arcs: nothing is inherited from them.
        at: (n,) byte after the last word, where further ones go; -1 where none can.
        barred: (n, 6) words that this kind of block does not take.
        names: For each :class:`Turn` the address of every column, as an inserted word has it.
        blank: Words are separated by blanks.
        rule: Convention of angles and axes for the tool frame.
        arcs: Arcs with a centre or a radius.
        marks: (n, 2) first byte and bytes of configuration words (w of them: (n, w, 2)).
    """

    numbers: Numbers
    value: Array
    unit: Array
    turn: IntArray
    skip: BoolArray
    at: IntArray
    barred: BoolArray
    names: tuple[tuple[bytes, ...], ...]
    blank: bool
    rule: OrientationRule
    arcs: PlaneArcs
    marks: IntArray


def take_words(words: PathWords, rows: slice) -> PathWords:
    """Returns the words of consecutive points with the arcs that end at them."""
    arcs, first = words.arcs, int(rows.start)
    own = np.flatnonzero((arcs.end >= first) & (arcs.end < rows.stop))
    moved = {name: getattr(arcs, name)[own] - first for name in ("start", "via", "end")}
    same = {name: getattr(arcs, name)[own] for name in ("kind", "plane", "left", "value")}
    columns = ("value", "unit", "turn", "skip", "at", "barred", "marks")
    return replace(
        words,
        numbers=words.numbers.rows(np.arange(first, rows.stop)),
        arcs=replace(arcs, numbers=arcs.numbers.rows(own), **moved, **same),
        **{name: getattr(words, name)[rows] for name in columns},
    )


def poses(
    value: Array, unit: Array, turn: IntArray, rule: OrientationRule, line: IntArray
) -> tuple[Array, ...]:
    """Returns position (n, 3) m, rotation (n, 3, 3) and axes (n, 6) rad, NaN where not known.

    Args:
        value: (n, 6) as printed, in the order of motion.
        unit: (n,) m per printed length.
        turn: (n,) :class:`Turn`.
        rule: Convention of angles and axes.
        line: (n,) one-based line of each, rising.
    """
    is_axes = (turn == Turn.AXES)[:, None]
    position = np.where(is_axes, np.nan, value[:, :3] * unit[:, None])
    axes = np.where(is_axes, value * DEG, np.nan)
    rotation = np.full((len(value), 3, 3), np.nan)
    rows = np.flatnonzero(turn == Turn.ANGLES)
    if len(rows) and rule.angles:
        rotation[rows] = matrices_from_abc(_abc(value[rows, 3:], rule), DEG)
    rows = np.flatnonzero((turn == Turn.VECTOR) | (turn == Turn.FIXED))
    rotation[rows] = rule.rotations(tool_axes(value[rows, 3:]), line[rows])
    return position, rotation, axes


def tool_axes(vector: Array) -> Array:
    """Returns unit vectors (n, 3) of printed ones; NaN where the length is not about 1."""
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(vector, axis=1)[:, None]
        fair = np.abs(length - 1.0) <= AXIS_MISS
        out: Array = np.where(fair, vector / np.where(fair, length, 1.0), np.nan)
    return out


def printed_angles(rotation: Array, near: Array, rule: OrientationRule) -> Array:
    """Returns A, B, C (n, 3) deg of matrices (n, 3, 3), nearest to those of ``near`` (n, 3)."""
    turned = np.ascontiguousarray(rotation, dtype=np.float64)
    found = abc_from_matrices(turned, _abc(near, rule) * DEG) / DEG
    return np.ascontiguousarray(found[:, ::-1]) if rule.angles == "rpy" else found


def _abc(printed: Array, rule: OrientationRule) -> Array:
    """KUKA's A, B, C of printed angles."""
    return np.ascontiguousarray(printed[:, ::-1] if rule.angles == "rpy" else printed)
