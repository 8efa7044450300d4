"""Targets in a table of numbers, rewritten in place or written out where there are none.

A target that a motion computes, and that has one value, is not printed as numbers: it is *written
out* in the place of the text that computes it, once it or what it is computed from moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.number_table import (
    Numbers,
    put_stretches,
    respell_in_style,
    respell_tokens,
)
from robotrue.program.formats.pose_write import PrintedForm, changed_rows, new_values
from robotrue.program.program import Program, Replacement


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenOut:
    """Targets of a program that are not printed as numbers, but have one value.

    Attributes:
        row: (w,) rows of the program, in file order.
        start: (w,) first byte of the text each takes the place of.
        end: (w,) byte after it.
        bound: (w,) a stored target they are computed from is moved to as well: they are written
            out with every change of the file.
        columns: Of each the columns of its numbers in the order they are printed.
    """

    row: IntArray
    start: IntArray
    end: IntArray
    bound: BoolArray
    columns: tuple[tuple[int, ...], ...] = ()

    def part(self, rows: slice, place: int) -> WrittenOut:
        """Returns those of some rows, counted from the first byte of their file."""
        inside = np.flatnonzero((self.row >= rows.start) & (self.row < rows.stop)).tolist()
        return WrittenOut(
            row=self.row[inside] - rows.start,
            start=self.start[inside] - place,
            end=self.end[inside] - place,
            bound=self.bound[inside],
            columns=tuple(self.columns[k] for k in inside if self.columns),
        )


_NONE: Final = np.zeros(0, np.int64)
NONE_WRITTEN: Final = WrittenOut(row=_NONE, start=_NONE, end=_NONE, bound=_NONE.astype(np.bool_))


@dataclass(frozen=True, slots=True, kw_only=True)
class TableSpans:
    """Places of the numbers of n targets.

    Attributes:
        numbers: (n, w) as in the language; poses and axis values come first.
        is_axis: (n,) the target is one of axis values.
        written: Rows that are written out; none of their numbers is printed.
    """

    numbers: Numbers
    is_axis: BoolArray
    written: WrittenOut = field(default=NONE_WRITTEN)


class PrintTarget(Protocol):
    """Prints a target that is written out."""

    def __call__(
        self, values: Array, decimals: list[int], columns: tuple[int, ...], *, axis: bool
    ) -> bytes:
        """Returns it from its row of numbers, their decimals, and which of them it has."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetForm:
    """How a language writes such targets.

    Attributes:
        printed: Poses and axis values.
        enough: (2, w) decimals that can hold a correction, of poses and of axis targets.
        least: (2, w) decimals to print where there are fewer.
        words: Columns of the configuration words.
        count_decimals: Returns the decimals of what is written out, by column, for poses and for
            axis targets.
        print_target: Prints what is written out.
        respell_odd: As for :func:`respell_tokens`.
        tidy: Numbers keep their columns, and stay apart from names before them.
    """

    printed: PrintedForm
    enough: IntArray
    least: IntArray
    words: slice | None = None
    count_decimals: Callable[[Program], tuple[list[int], list[int]]] | None = None
    print_target: PrintTarget | None = None
    respell_odd: Callable[[bytes, float, int], bytes] = respell_in_style
    tidy: bool = False


def write_table(
    program: Program,
    replacement: Replacement,
    spans: TableSpans,
    form: TargetForm,
    *,
    value: Array | None = None,
    put_in: Callable[[bytes, IntArray, Array], tuple[bytes, IntArray]] | None = None,
) -> bytes:
    """Returns the bytes with the numbers of the changed rows replaced and nothing else touched.

    Args:
        program: As it was read.
        replacement: What its targets shall be.
        spans: Places of its numbers.
        form: Of the language.
        value: (n, w) what the controller has for the numbers, if not what is printed.
        put_in: Returns bytes put into, and the new starts of all numbers, from the bytes, the
            starts (n, w) and the new values (n, w).

    Raises:
        ShapeError: A changed row has a value that is not finite, or too large to be printed.
    """
    changed = changed_rows(program, replacement)
    if not changed.any():
        return program.data
    numbers, is_axis, columns = spans.numbers, spans.is_axis, form.words
    width = numbers.value.shape[1]
    given = numbers.value if value is None else value
    values, touched = new_values(program, replacement, given, is_axis, form.printed)
    if columns is not None:
        words = np.asarray(replacement.words, dtype=np.int64)
        told = (words != NO_WORD) & changed[:, None] & np.isfinite(numbers.value[:, columns])
        touched[:, columns] = told
        values[:, columns] = np.where(told, words, values[:, columns])
    data, start = program.data, numbers.start
    if len(spans.written.row):
        differ = (touched & (values != numbers.value)).any(axis=1)
        data, start = _write_out(program, spans, form, values, differ)
    if put_in is not None:
        data, start = put_in(data, start, values)
    kind = is_axis.astype(np.int64)
    return respell_tokens(
        data, replace(numbers, start=start), values, touched, form.enough[kind, :width],
        form.least[kind, :width],
        aligned=form.tidy, apart=form.tidy, respell_odd=form.respell_odd,
    )  # fmt: skip


def _write_out(
    program: Program, spans: TableSpans, form: TargetForm, values: Array, moves: BoolArray
) -> tuple[bytes, IntArray]:
    """Returns the bytes with targets written out that move, and where the other numbers are."""
    written, start = spans.written, spans.numbers.start
    chosen = np.flatnonzero(moves[written.row] | (written.bound & moves.any())).tolist()
    if not chosen or form.print_target is None or form.count_decimals is None:
        return program.data, start
    decimals = form.count_decimals(program)
    stretches = []
    for k in chosen:
        row, begin, end = int(written.row[k]), int(written.start[k]), int(written.end[k])
        axis, columns = bool(spans.is_axis[row]), written.columns[k] if written.columns else ()
        text = form.print_target(values[row], decimals[axis], columns, axis=axis)
        stretches.append((begin, end - begin, text))
    return put_stretches(program.data, stretches, start)
