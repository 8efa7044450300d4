"""Splices new numbers into the bytes of a KRL file; every other byte is copied.

The rule for one number, in the unit it is printed in: with ``d`` the decimals it was printed with
(4 if it had fewer than 3, so that a correction of a hundredth of a millimetre is not rounded away;
6 if it had an exponent), it is rewritten only when the new value is further than half of the last
of those digits from the number that stands there. A ``+`` and a bare ``.5`` stay in style, and a
number standing after two or more blanks keeps its column. S and T keep their base (decimal,
``'B..'``, ``'H..'``).
"""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray, Ints
from robotrue.core.compiled import PLAIN, compiled
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.program.euler import renew_abc
from robotrue.program.formats.krl_spans import (
    KrlSpans,
    format_aggregate,
    states_other_words,
    written_decimals,
)
from robotrue.program.formats.number_kernels import (
    SLACK,
    copy_bytes,
    copy_short,
    place,
    put_number,
    put_whole,
)
from robotrue.program.formats.written_out import (
    put_texts,
    shift_places,
)
from robotrue.program.program import Program, Replacement

_SAME_POSITION: Final = 1e-11
"""m; coordinates nearer than this to the ones read are the ones read."""
_SAME_ROTATION: Final = 1e-10
"""Largest difference of a matrix element (6e-9 deg) of an orientation that counts as unchanged.

Near gimbal lock equal matrices may give A and C that differ in every printed digit.
"""
_INHERITED: Final = 0.5e-4
"""mm or deg; a component is inserted when what it would inherit is further off than this."""
_LARGEST: Final = 1e9
_HALF_DIGIT: Final = np.array([0.5 * 10.0**-k for k in range(16)])
_ROWS: Final = 1 << 12
"""Targets written at a time: what they need stays in the nearer caches."""
_WIDEST: Final = 28
"""Bytes one rewritten number can take: sign, ten digits, point, fifteen decimals, padding apart."""
_WORDS: Final = 64
"""The same for S and T of a target."""


def write_krl(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the numbers of the changed rows replaced and nothing else touched.

    A component a target leaves out is inserted behind its last one when the target, or the one it
    inherits from, moved; this is the only case in which bytes are added that stood nowhere. The
    auxiliary point of an arc gets no orientation it did not have: controllers ignore it.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    spans = program.spans
    if not isinstance(spans, KrlSpans):
        raise ShapeError(f"{program.name} was not read by the krl dialect, but by another.")
    changed = np.asarray(replacement.changed, dtype=np.bool_)
    if changed.shape != (len(program),):
        raise ShapeError(f"changed has shape {changed.shape}, expected ({len(program)},).")
    if not changed.any():
        return program.data
    if len(spans.written.row):
        program, replacement, spans = _write_out(program, replacement, spans, changed)
        changed = np.asarray(replacement.changed)
    # What a target leaves out hangs on targets before it: such a program is one piece.
    step = _ROWS if not len(spans.partial) else max(len(program), 1)
    out, source = io.BytesIO(), np.frombuffer(program.data, np.uint8)
    begin = 0
    for first in range(0, len(program), step):
        rows = slice(first, min(first + step, len(program)))
        last = rows.stop == len(program)
        end = len(program.data) if last else _behind(spans, rows.stop - 1)
        if not changed[rows].any():
            out.write(source[begin:end].data)
            begin = end
            continue
        _write_rows(program, replacement, spans, changed, rows, source[begin:end], begin, out)
        begin = end
    return out.getvalue()


def _write_out(
    program: Program, replacement: Replacement, spans: KrlSpans, changed: BoolArray
) -> tuple[Program, Replacement, KrlSpans]:
    """Returns all three with the rows that are written out in their places, and done."""
    written = spans.written
    values, touched = _new_values(program, replacement, spans, changed, slice(0, len(program)))
    moves = touched.any(axis=1) | (changed & states_other_words(spans, replacement.words))
    chosen = np.flatnonzero(moves[written.row] | (spans.bound & moves.any())).tolist()
    rows = written.row[chosen].tolist()
    texts, decimals = [], written_decimals(program.data, spans) if rows else []
    for row in rows:
        first = int(spans.token[row])
        tokens = range(first, first + int(spans.tokens[row]))
        words = replacement.words[row].tolist() if changed[row] else [-1, -1]
        texts.append(format_aggregate(spans, tokens, values[row], words, decimals))
    data, places, moved = put_texts(program.data, written, chosen, texts)
    left = np.array(changed)
    left[written.row] = False
    start = shift_places(spans.start.astype(np.int64), places, moved).astype(np.int32)
    spans = replace(spans, start=start)
    return replace(program, data=data), replace(replacement, changed=left), spans


def _behind(spans: KrlSpans, row: int) -> int:
    """Returns where the last number of a row ends: what stands before the next is with the next."""
    token = int(spans.token[row] + spans.tokens[row]) - 1
    return int(spans.start[token] + spans.length[token])


def _write_rows(
    program: Program,
    replacement: Replacement,
    spans: KrlSpans,
    changed: BoolArray,
    rows: slice,
    source: Bytes,
    begin: int,
    out: io.BytesIO,
) -> None:
    """Writes the bytes ``source``, which begin at ``begin`` and hold the rows, to ``out``."""
    values, touched = _new_values(program, replacement, spans, changed, rows)
    row, component, value = _insertions(spans, values)
    room = len(source) + _WIDEST * (values.size + 2 * len(row)) + _WORDS * len(values) + SLACK
    text = np.empty(room, np.uint8)
    size = _splice(
        source,
        begin,
        spans.token[rows],
        spans.tokens[rows],
        spans.component,
        spans.start,
        spans.length,
        spans.value,
        values,
        touched,
        np.array(changed[rows]),
        np.array(replacement.words[rows], dtype=np.int64, order="C"),
        row,
        component,
        value,
        text,
        np.empty(96, np.uint8),
    )
    out.write(text[:size].data)


def _new_values(
    program: Program,
    replacement: Replacement,
    spans: KrlSpans,
    changed: BoolArray,
    rows: slice,
) -> tuple[Array, BoolArray]:
    """Returns what every row shall say, (m, 6) in mm and deg, and which of it may differ."""
    values = printed_values(spans, rows)
    touched = np.zeros(values.shape, dtype=np.bool_)
    is_axis, mine = spans.is_axis[rows], changed[rows]
    rotation = np.ascontiguousarray(replacement.rotation[rows], dtype=np.float64)
    _new_poses(
        mine & ~is_axis,
        program.position[rows],
        np.ascontiguousarray(replacement.position[rows], dtype=np.float64),
        program.rotation[rows],
        rotation,
        values,
        touched,
    )
    renew_abc(rotation, np.flatnonzero(touched[:, 3]), values, DEG)
    axis = np.flatnonzero(mine & is_axis)
    if len(axis):
        new, old = replacement.axes[rows][axis], program.axes[rows][axis]
        move = np.abs(new - old) > _SAME_ROTATION
        move |= ~np.isfinite(new)
        values[axis] = np.where(move, new / DEG, values[axis])
        touched[axis] = move
    at = _beyond(values, touched)
    if at >= 0:
        raise ShapeError(
            f"the new target is {values[at].tolist()} (mm, deg), expected finite numbers "
            "below 1e9.",
            source=program.name,
            line=int(program.line[rows][at]),
            hint="leave this row unchanged.",
        )
    return values, touched


@compiled(PLAIN)
def _beyond(values: Array, touched: BoolArray) -> int:
    """Returns the first row with a touched value that cannot be written, -1 if there is none."""
    for row in range(len(values)):
        for c in range(6):
            if touched[row, c] and not abs(values[row, c]) < _LARGEST:
                return row
    return -1


@compiled(PLAIN)
def _new_poses(
    rows: BoolArray,
    position: Array,
    moved: Array,
    rotation: Array,
    turned: Array,
    values: Array,
    touched: BoolArray,
) -> None:
    """Fills in the new positions of the changed rows and marks what may differ."""
    for row in range(rows.size):
        if not rows[row]:
            continue
        for c in range(3):
            if not abs(moved[row, c] - position[row, c]) <= _SAME_POSITION:
                values[row, c] = moved[row, c] / MM
                touched[row, c] = True
        same = True
        for i in range(3):
            for j in range(3):
                same &= abs(turned[row, i, j] - rotation[row, i, j]) <= _SAME_ROTATION
        if not same:
            touched[row, 3:] = True


def printed_values(spans: KrlSpans, rows: slice = slice(None)) -> Array:
    """Returns X..C or A1..A6 of rows as the controller has them, (m, 6) in mm and deg.

    ``rows`` must be all rows if some leave components out.
    """
    token = spans.token[rows]
    values = np.full((len(token), 6), np.nan)
    _gather(token, spans.tokens[rows], spans.component, spans.value, values)
    for row, donor in zip(spans.partial.tolist(), spans.donor, strict=True):
        c = np.flatnonzero(donor >= 0)
        values[row, c] = values[donor[c], c]
    return values


def _insertions(spans: KrlSpans, values: Array) -> tuple[IntArray, IntArray, Array]:
    """Returns (row, component code, value) of what must be written where nothing stood."""
    rows: list[int] = []
    columns: list[int] = []
    # What the controller will have, where that is not what the row is to say.
    reached: dict[tuple[int, int], float] = {}
    for row, donor, owed in zip(spans.partial.tolist(), spans.donor, spans.owed, strict=True):
        for c in np.flatnonzero(owed).tolist():
            from_row = int(donor[c])
            have = reached.get((from_row, c), values[from_row, c])
            if abs(values[row, c] - have) > _INHERITED:
                rows.append(row)
                columns.append(c)
            else:
                reached[row, c] = have
    order = np.argsort(np.array(rows, np.int64), kind="stable")
    row_at, column = np.array(rows, np.int64)[order], np.array(columns, np.int64)[order]
    return row_at, column + 6 * spans.is_axis[row_at], values[row_at, column]


@compiled(PLAIN)
def _gather(token: Ints, tokens: Ints, component: Bytes, value: Array, values: Array) -> None:
    for row in range(token.size):
        for t in range(token[row], token[row] + tokens[row]):
            if component[t] < 12:
                values[row, component[t] % 6] = value[t]


@compiled(PLAIN, inline=True)
def _style(buf: Bytes, start: int, end: int) -> tuple[int, bool, bool]:
    """Returns (decimals to write, has a plus, has no digit before the point)."""
    sign = buf[np.uint64(start)]
    first = start + (sign == 43 or sign == 45)
    point = end - 1
    while point >= first and 48 <= buf[np.uint64(point)] <= 57:
        point -= 1
    if point >= first and buf[np.uint64(point)] == 46:
        decimals = end - 1 - point
        return min(decimals if decimals >= 3 else 4, 15), sign == 43, point == first
    decimals, point, exponent = 0, -1, False
    for i in range(start, end):
        if buf[i] == 46:
            point = i
        elif buf[i] == 69 or buf[i] == 101:
            exponent = True
            break
        elif point >= 0 and 48 <= buf[i] <= 57:
            decimals += 1
    if exponent:
        decimals = 6
    elif decimals < 3:
        decimals = 4
    return min(decimals, 15), sign == 43, point == first


@compiled(PLAIN, inline=True)
def _in_a_name(byte: int) -> bool:
    """Returns whether a digit behind the byte would be a part of a name."""
    return 48 <= byte <= 57 or 65 <= (byte & 223) <= 90 or byte == 95


@compiled(PLAIN)
def _integer(out: Bytes, k: int, value: int, buf: Bytes, start: int, end: int) -> int:
    """Writes S or T in the base and at least the digits of the bytes it replaces."""
    if buf[start] != 39:
        return put_whole(out, k, value)
    base = 2 if (buf[start + 1] & 223) == 66 else 16
    size, rest = 1, value // base
    while rest > 0:
        size += 1
        rest //= base
    size = max(size, end - start - 3)
    out[k], out[k + 1] = 39, buf[start + 1]
    for i in range(size):
        digit = value % base
        value //= base
        out[k + 1 + size - i] = digit + (48 if digit < 10 else 55)
    out[k + 2 + size] = 39
    return k + 3 + size


@compiled(PLAIN)
def _insert(out: Bytes, k: int, component: int, value: float, decimals: int) -> int:
    """Writes ``,NAME value`` for a left-out component."""
    out[k] = 44
    k += 1
    if component < 3:
        out[k] = 88 + component
    elif component < 6:
        out[k] = 62 + component
    else:
        out[k] = 65
        k += 1
        out[k] = 43 + component
    out[k + 1] = 32
    return put_number(out, k + 2, value, decimals, False, False)


@compiled(PLAIN)
def _splice(
    buf: Bytes,
    begin: int,
    token: Ints,
    tokens: Ints,
    component: Bytes,
    start: Ints,
    length: npt.NDArray[np.uint16],
    old: Array,
    values: Array,
    touched: BoolArray,
    changed: BoolArray,
    words: IntArray,
    add_row: IntArray,
    add_component: IntArray,
    add_value: Array,
    out: Bytes,
    scratch: Bytes,
) -> int:
    """Copies ``buf`` to ``out`` with the new numbers; returns the bytes written.

    ``begin`` is where ``buf`` begins in the file, ``scratch`` (96,) work space.
    """
    cursor, k, add = 0, 0, 0
    swift = buf.size - SLACK  # up to here whole words may be copied
    for row in range(token.size):
        inserting = add < add_row.size and add_row[add] == row
        most = 0
        for t in range(token[row], token[row] + tokens[row]):
            code, size = np.int64(component[np.uint64(t)]), 0
            first = start[np.uint64(t)] - begin
            last = first + length[np.uint64(t)]
            if code < 12:
                column = np.uint64(code if code < 6 else code - 6)
                moved = touched[np.uint64(row), column]
                if not (moved or inserting):
                    continue
                decimals, plus, bare = _style(buf, first, last)
                most = max(most, decimals)
                new = values[np.uint64(row), column]
                if not moved or abs(new - old[np.uint64(t)]) <= _HALF_DIGIT[np.uint64(decimals)]:
                    continue
                before = buf[np.uint64(first - 1)] if first > 0 else 32
                if first - 2 < cursor or before != 32 or buf[np.uint64(first - 2)] != 32:
                    if first <= swift:
                        k = copy_short(out, k, buf, cursor, first)
                    else:
                        k = copy_bytes(out, k, buf, cursor, first)
                    cursor = last
                    if not _in_a_name(before):
                        k = put_number(out, k, new, decimals, plus, bare)
                        continue
                    size = put_number(scratch, 0, new, decimals, plus, bare)
                    if 48 <= scratch[0] <= 57:  # X-9, Z.5 and Z'B0' hold numbers, X9 is a name
                        out[k] = 32
                        k += 1
                    k = copy_bytes(out, k, scratch, 0, size)
                    continue
                size = put_number(scratch, 0, new, decimals, plus, bare)
            elif 18 <= code and changed[row]:
                word = words[row, code - 18]
                if word >= 0 and word != old[t]:
                    size = _integer(scratch, 0, word, buf, first, last)
            if size > 0:
                k = place(out, k, buf, cursor, first, last, scratch, size)
                cursor = last
        if inserting:
            t = token[row] + tokens[row] - 1
            last = start[t] + length[t] - begin
            k = copy_bytes(out, k, buf, cursor, last)
            cursor = last
            while add < add_row.size and add_row[add] == row:
                k = _insert(out, k, add_component[add], add_value[add], max(most, 4))
                add += 1
    return copy_bytes(out, k, buf, cursor, buf.size)
