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
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.units import DEG, MM
from robotrue.program.euler import renew_abc
from robotrue.program.formats.krl_scan import COMPONENTS
from robotrue.program.formats.krl_spans import (
    KrlSpans,
    format_aggregate,
    states_other_words,
    written_decimals,
)
from robotrue.program.formats.number_table import Numbers, put_stretches, respell_tokens
from robotrue.program.formats.number_text import respell_word, restyle
from robotrue.program.formats.pose_write import PrintedForm, changed_rows, new_values, spans_of
from robotrue.program.program import Program, Replacement

_INHERITED: Final = 0.5e-4
"""mm or deg; a component is inserted when what it would inherit is further off than this."""
_ROWS: Final = 1 << 12
"""Targets written at a time: what they need stays in the nearer caches."""
_ENOUGH: Final = np.array([3] * 6 + [99] * 2)
_LEAST: Final = np.array([4] * 6 + [-1] * 2)
"""Decimals that can hold a correction, and those to print where there are fewer; S, T have none."""
_FINE: Final = 6
"""Decimals of a number that had an exponent."""


def write_krl(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the numbers of the changed rows replaced and nothing else touched.

    A component a target leaves out is inserted behind its last one when the target, or the one it
    inherits from, moved; this is the only case in which bytes are added that stood nowhere. The
    auxiliary point of an arc gets no orientation it did not have: controllers ignore it.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    spans = spans_of(program, KrlSpans, "krl")
    changed = changed_rows(program, replacement)
    if not changed.any():
        return program.data
    if len(spans.written.row):
        program, replacement, spans = _write_out(program, replacement, spans, changed)
        changed = np.asarray(replacement.changed)
    # What a target leaves out hangs on targets before it: such a program is one piece.
    step = _ROWS if not len(spans.partial) else max(len(program), 1)
    out, source, begin = io.BytesIO(), memoryview(program.data), 0
    for first in range(0, len(program), step):
        rows = slice(first, min(first + step, len(program)))
        last = rows.stop == len(program)
        end = len(program.data) if last else _behind(spans, rows.stop - 1)
        if changed[rows].any():
            out.write(_respell_rows(program, replacement, spans, rows, (begin, end)))
        else:
            out.write(source[begin:end])
        begin = end
    return out.getvalue()


def _write_out(
    program: Program, replacement: Replacement, spans: KrlSpans, changed: BoolArray
) -> tuple[Program, Replacement, KrlSpans]:
    """Returns all three with the rows that are written out in their places, and done."""
    written = spans.written
    every = printed_values(spans, _tabulate(spans, slice(None)))
    values, touched = new_values(program, replacement, every, spans.is_axis, _FORM)
    moves = touched.any(axis=1) | (changed & states_other_words(spans, replacement.words))
    chosen = np.flatnonzero(moves[written.row] | (spans.bound & moves.any())).tolist()
    rows = written.row[chosen].tolist()
    texts, decimals = [], written_decimals(program.data, spans) if rows else []
    for row in rows:
        first = int(spans.token[row])
        tokens = range(first, first + int(spans.tokens[row]))
        words = replacement.words[row].tolist() if changed[row] else [-1, -1]
        texts.append(format_aggregate(spans, tokens, values[row], words, decimals))
    stretches = written.stretches(chosen, texts)
    data, start = put_stretches(program.data, stretches, spans.start.astype(np.int64))
    left = np.array(changed)
    left[written.row] = False
    spans = replace(spans, start=start.astype(np.int32))
    return replace(program, data=data), replace(replacement, changed=left), spans


def _behind(spans: KrlSpans, row: int) -> int:
    """Returns where the last number of a row ends: what stands before the next is with the next."""
    token = int(spans.token[row] + spans.tokens[row]) - 1
    return int(spans.start[token] + spans.length[token])


def _respell_rows(
    program: Program,
    replacement: Replacement,
    spans: KrlSpans,
    rows: slice,
    piece: tuple[int, int],
) -> bytes:
    """Returns the bytes between two places, which hold the rows, with what the rows shall say."""
    numbers, is_axis = _tabulate(spans, rows), spans.is_axis[rows]
    printed = printed_values(spans, numbers)
    values, touched = new_values(program, replacement, printed, is_axis, _FORM, rows)
    data, start = program.data[piece[0] : piece[1]], numbers.start - piece[0]
    if len(spans.partial):
        data, start = _insert_owed(data, spans, numbers, values, start)
    words = np.asarray(replacement.words[rows], dtype=np.int64)
    told = (words >= 0) & (words != numbers.value[:, 6:])
    touched[:, 6:] = told & np.asarray(replacement.changed[rows], dtype=np.bool_)[:, None]
    values[:, 6:] = words
    enough, least = (np.broadcast_to(few, values.shape) for few in (_ENOUGH, _LEAST))
    numbers = replace(numbers, start=start)
    return respell_tokens(
        data, numbers, values, touched, enough, least, aligned=True, apart=True,
        respell_odd=_respell_odd,
    )  # fmt: skip


def _turn(rotation: Array, printed: Array) -> Array:
    renew_abc(np.ascontiguousarray(rotation), np.arange(len(rotation)), printed, DEG)
    return printed


_FORM: Final = PrintedForm(length=MM, turns=3, turn=_turn, axis=DEG, unit="mm, deg")


def _tabulate(spans: KrlSpans, rows: slice) -> Numbers:
    """Returns the numbers (m, 8) of rows: X..C or A1..A6, then S and T."""
    token, tokens = spans.token[rows], spans.tokens[rows]
    shape = (len(token), 8)
    start, length = np.full(shape, -1), np.zeros(shape, np.int64)
    value = np.full(shape, np.nan)
    _gather(
        token, tokens, spans.component, spans.start, spans.length, spans.value, start, length, value
    )
    return Numbers(start=start, length=length, value=value)


@compile_kernel(PLAIN)
def _gather(
    token: Ints,
    tokens: Ints,
    component: Bytes,
    begun: Ints,
    size: npt.NDArray[np.uint16],
    said: Array,
    start: IntArray,
    length: IntArray,
    value: Array,
) -> None:
    """Fills the tables (m, 8) from the tokens of every row."""
    for row in range(token.size):
        for t in range(token[row], token[row] + tokens[row]):
            code = component[t]
            if code < 12 or code >= 18:
                column = code % 6 if code < 12 else code - 12
                start[row, column], length[row, column] = begun[t], size[t]
                value[row, column] = said[t]


def printed_values(spans: KrlSpans, numbers: Numbers) -> Array:
    """Returns numbers (m, 8) with X..C or A1..A6 as the controller has them, in mm and deg.

    They must be of all rows if some leave components out.
    """
    values = numbers.value.copy()
    for row, donor in zip(spans.partial.tolist(), spans.donor, strict=True):
        c = np.flatnonzero(donor >= 0)
        values[row, c] = values[donor[c], c]
    return values


def _insert_owed(
    data: bytes, spans: KrlSpans, numbers: Numbers, values: Array, start: IntArray
) -> tuple[bytes, IntArray]:
    """Returns the bytes with left-out components behind the last of their target, and new starts.

    They get the decimals of the number of their target that has the most.
    """
    texts: dict[int, bytes] = {}
    for row, column in _find_owed(spans, values):
        ends = start[row] + numbers.length[row]
        shown = [data[a:b] for a, b in zip(start[row, :6], ends[:6], strict=True) if a >= 0]
        style = b"0." + b"0" * max(4, *map(_count_decimals, shown))
        name = COMPONENTS[column + 6 * int(spans.is_axis[row])].encode()
        text = b"," + name + b" " + restyle(style, values[row, column])
        texts[row] = texts.get(row, b"") + text
    rows = np.array(sorted(texts), np.int64)
    last = spans.token[rows] + spans.tokens[rows] - 1
    place = spans.start[last].astype(np.int64) + spans.length[last]
    stretches = [(at, 0, texts[k]) for at, k in zip(place.tolist(), rows.tolist(), strict=True)]
    return put_stretches(data, stretches, start)


def _find_owed(spans: KrlSpans, values: Array) -> list[tuple[int, int]]:
    """Returns (row, column) of what must be written where nothing stood."""
    owed: list[tuple[int, int]] = []
    # What the controller will have, where that is not what the row is to say.
    reached: dict[tuple[int, int], float] = {}
    for row, donor, lacking in zip(spans.partial.tolist(), spans.donor, spans.owed, strict=True):
        for c in np.flatnonzero(lacking).tolist():
            from_row = int(donor[c])
            have = reached.get((from_row, c), values[from_row, c])
            if abs(values[row, c] - have) > _INHERITED:
                owed.append((row, c))
            else:
                reached[row, c] = have
    return owed


def _count_decimals(token: bytes) -> int:
    """Returns with how many decimals a number is rewritten."""
    if b"e" in token.lower():
        return _FINE
    decimals = len(token.partition(b".")[2])
    return min(decimals if decimals >= _ENOUGH[0] else int(_LEAST[0]), 15)


def _respell_odd(token: bytes, value: float, least: int) -> bytes:
    """Returns S or T (``least`` below 0) in its base, a number with an exponent without it."""
    if least < 0:
        return respell_word(token, int(value))
    if b"e" not in token.lower():
        return restyle(token, value, least=least)
    if abs(value - float(b"".join(token.split()))) <= 0.5 * 10.0**-_FINE:
        return token
    plus = b"+" if token.startswith(b"+") else b""
    whole = b"" if token.lstrip(b"+-").startswith(b".") else b"0"
    return restyle(plus + whole + b"." + b"0" * _FINE, value)
