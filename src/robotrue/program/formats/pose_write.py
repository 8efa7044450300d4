"""Checked new text of changed targets, for languages with a table of numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ShapeError
from robotrue.program.program import Program, Replacement

_SAME_POSITION: Final = 1e-11
"""m; coordinates nearer than this to the ones read are the ones read."""
SAME_ROTATION: Final = 1e-10
"""Largest difference of a matrix element, or rad of an axis, that counts as unchanged."""
_LARGEST: Final = 1e9
Spans = TypeVar("Spans")


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedForm:
    """Printed form of targets: three coordinates and three turns, or axis values.

    Attributes:
        length: m per unit of a coordinate.
        turns: Count of the numbers of the orientation.
        turn: Returns those of rotations (k, 3, 3) nearest to (k, turns) as printed.
        axis: rad per unit of an axis value, for all or (n, 6).
        unit: Of the numbers, for messages.
    """

    length: float
    turns: int
    turn: Callable[[Array, Array], Array]
    axis: float | Array
    unit: str


def spans_of(program: Program, kind: type[Spans], dialect: str) -> Spans:
    """Returns the places of the numbers of a program, in the table of its dialect.

    Raises:
        ShapeError: It was read by another one.
    """
    if not isinstance(program.spans, kind):
        raise ShapeError(f"{program.name} was not read by the {dialect} dialect, but by another.")
    return program.spans


def changed_rows(program: Program, replacement: Replacement) -> BoolArray:
    """Returns the rows to rewrite (n,).

    Raises:
        ShapeError: Of another length than the program.
    """
    changed = np.asarray(replacement.changed, dtype=np.bool_)
    if changed.shape != (len(program),):
        raise ShapeError(f"changed has shape {changed.shape}, expected ({len(program)},).")
    return changed


def new_words(program: Program, replacement: Replacement) -> BoolArray:
    """Returns the configuration words (n, w) that change: requested, and known before."""
    new = np.asarray(replacement.words, dtype=np.int64)
    told = (new != NO_WORD) & (program.words != NO_WORD) & (new != program.words)
    return np.asarray(changed_rows(program, replacement)[:, None] & told)


def new_values(
    program: Program,
    replacement: Replacement,
    value: Array,
    is_axis: BoolArray,
    form: PrintedForm,
    rows: slice = slice(None),
) -> tuple[Array, BoolArray]:
    """Returns the new numbers of n rows, as printed, and which of them may differ.

    Args:
        program: As it was read.
        replacement: What its targets shall be.
        value: (n, w) the numbers as printed: coordinates and turns, or six axis values, come first.
        is_axis: (n,) the row holds axis values.
        form: Of the language.
        rows: Of the program and the replacement that are meant.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9, with its line.
    """
    changed = changed_rows(program, replacement)[rows]
    place, turn, axes = find_moved(program, replacement, rows)
    values, touched = np.array(value), np.zeros(value.shape, np.bool_)
    pose, end = changed & ~is_axis, 3 + form.turns
    touched[:, :3] = place & pose[:, None]
    new = np.asarray(replacement.position[rows], dtype=np.float64) / form.length
    values[:, :3] = np.where(touched[:, :3], new, values[:, :3])
    spun = np.flatnonzero(turn & pose)
    turned = np.asarray(replacement.rotation[rows], dtype=np.float64)[spun]
    values[spun, 3:end] = form.turn(turned, values[spun, 3:end])
    touched[spun, 3:end] = True
    at = np.flatnonzero(changed & is_axis)
    if len(at):
        touched[at, :6] = axes[at]
        unit = np.broadcast_to(form.axis, (len(values), 6))[at]
        wanted = np.asarray(replacement.axes[rows], dtype=np.float64)[at] / unit
        values[at, :6] = np.where(axes[at], wanted, values[at, :6])
    end = max(end, 6)
    require_printable(program, values[:, :end], touched[:, :end], form.unit, rows)
    return values, touched


def find_moved(
    program: Program, replacement: Replacement, rows: slice = slice(None)
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Returns which coordinates (n, 3), orientations (n,) and axes (n, dof) are not as read.

    What is not finite in the replacement counts as moved, so that it is refused and not passed by.
    """
    with np.errstate(invalid="ignore"):
        place = ~(np.abs(replacement.position[rows] - program.position[rows]) <= _SAME_POSITION)
        axes = ~(np.abs(replacement.axes[rows] - program.axes[rows]) <= SAME_ROTATION)
        turned = ~(np.abs(replacement.rotation[rows] - program.rotation[rows]) <= SAME_ROTATION)
    return place, np.asarray(turned.any(axis=(1, 2))), axes


def require_printable(
    program: Program,
    values: Array,
    touched: BoolArray,
    unit: str,
    rows: slice = slice(None),
) -> None:
    """Refuses values of some rows that no controller reads.

    Raises:
        ShapeError: A touched value is not finite, or not below 1e9, with its line.
    """
    bad = touched & ~(np.abs(values) < _LARGEST)
    if bad.any():
        at = int(np.argwhere(bad)[0][0])
        raise ShapeError(
            f"the new target is {values[at].tolist()} ({unit}), expected finite numbers below 1e9.",
            source=program.name,
            line=int(program.line[rows][at]),
            hint="leave this row unchanged.",
        )
