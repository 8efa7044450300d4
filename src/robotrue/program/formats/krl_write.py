"""Splices new numbers into the bytes of a KRL file; every other byte is copied.

The rule for one number, in the unit it is printed in: with ``d`` the decimals it was printed with
(4 if it had fewer than 3, so that a correction of a hundredth of a millimetre is not rounded away;
6 if it had an exponent), it is rewritten only when the new value is further than half of the last
of those digits from the printed number. A ``+`` and a bare ``.5`` keep their style, and a number
after two or more blanks keeps its column. S and T keep their base (decimal, ``'B..'``, ``'H..'``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG, MM
from robotrue.program.euler import renew_abc
from robotrue.program.formats.krl_scan import COMPONENTS, EXTERNAL, STATUS, scan
from robotrue.program.formats.number_table import put_stretches
from robotrue.program.formats.number_text import respell_word, restyle
from robotrue.program.formats.path_kernels import decimals_of
from robotrue.program.formats.pose_write import PrintedForm, spans_of
from robotrue.program.formats.written_out import TableSpans, TargetForm, write_table
from robotrue.program.program import Program, Replacement

_INHERITED: Final = 0.5e-4
"""mm or deg; a component is inserted when what it would inherit is further off than this."""
_ENOUGH: Final = 3
_LEAST: Final = 4
"""Decimals that can hold a correction, and those to print where there are fewer."""
_FINE: Final = 6
"""Decimals of a number that had an exponent."""
_MOST: Final = 9
"""Decimals of what is written out."""
_WORDS: Final = slice(6, 8)
_BESIDE: Final = 8
"""First column of external axes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KrlSpans(TableSpans):
    """Places of the numbers: X..C or A1..A6, S and T, and E1..E6 if the file has any.

    Attributes:
        partial: (p,) rows with components left out that they inherit, in the order of motion.
        donor: (p, 6) the row each left-out component is inherited from, -1 if it is written.
        owed: (p, 6) left-out components that are inserted when the inherited value is not right.
    """

    partial: IntArray
    donor: IntArray
    owed: BoolArray


def column_of(component: int) -> int:
    """Returns the column of a component by its code."""
    if component < EXTERNAL:
        return component % 6
    return (
        component - STATUS + _WORDS.start if component >= STATUS else component - EXTERNAL + _BESIDE
    )


def write_krl(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the numbers of the changed rows replaced and nothing else touched.

    A component that a target leaves out is inserted after its last one when the target, or the one
    it inherits from, moved; this is the only case in which bytes are added. The auxiliary point of
    an arc gets no orientation if it had none: controllers ignore it.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    spans = spans_of(program, KrlSpans, "krl")
    put_in = partial(_insert_owed, spans) if len(spans.partial) else None
    value = _controller_values(spans)
    return write_table(program, replacement, spans, _FORM, value=value, put_in=put_in)


def _controller_values(spans: KrlSpans) -> Array:
    """Returns the numbers (n, w) with X..C or A1..A6 as the controller has them, in mm and deg."""
    if not len(spans.partial):
        return spans.numbers.value
    values = spans.numbers.value.copy()
    for row, donor in zip(spans.partial.tolist(), spans.donor, strict=True):
        c = np.flatnonzero(donor >= 0)
        values[row, c] = values[donor[c], c]
    return values


def _insert_owed(
    spans: KrlSpans, data: bytes, start: IntArray, values: Array
) -> tuple[bytes, IntArray]:
    """Returns the bytes with left-out components after the last of their target, and new starts.

    They get the decimals of the number of their target that has the most.
    """
    texts: dict[int, bytes] = {}
    ends = np.where(start < 0, -1, start + spans.numbers.length)
    for row, column in _find_owed(spans, values):
        pairs = zip(start[row, :6].tolist(), ends[row, :6].tolist(), strict=True)
        shown = [data[a:b] for a, b in pairs if a >= 0]
        style = b"0." + b"0" * max(4, *map(_count_decimals, shown))
        name = COMPONENTS[column + 6 * int(spans.is_axis[row])].encode()
        text = b"," + name + b" " + restyle(style, values[row, column])
        texts[row] = texts.get(row, b"") + text
    stretches = [(int(ends[row].max()), 0, texts[row]) for row in sorted(texts)]
    return put_stretches(data, stretches, start)


def _find_owed(spans: KrlSpans, values: Array) -> list[tuple[int, int]]:
    """Returns (row, column) of the numbers that must be inserted."""
    owed: list[tuple[int, int]] = []
    # The controller's value, where it differs from the row's.
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
    return min(decimals if decimals >= _ENOUGH else _LEAST, 15)


def _count_written(program: Program) -> tuple[list[int], list[int]]:
    """Returns as many decimals as the file has for a component, within bounds."""
    found = scan(program.data, name=program.name)
    table = found.tok_start[:, None].astype(np.int64), found.tok_length[:, None].astype(np.int64)
    have = decimals_of(np.frombuffer(program.data, np.uint8), *table)[:, 0]
    most = np.repeat([4, 6, 5, 5, 0], 3)
    np.maximum.at(most, np.minimum(found.tok_component, EXTERNAL), have)
    decimals = np.minimum(most, _MOST).tolist()
    return decimals[:6], decimals[6:12]


def _print_target(
    values: Array, decimals: list[int], columns: Sequence[int], *, axis: bool
) -> bytes:
    """Returns a target in braces; external axes stay as they were."""
    parts = []
    for column in columns:
        value = float(values[column])
        if column < _WORDS.start:
            name, text = COMPONENTS[column + 6 * axis], f"{value + 0.0:.{decimals[column]}f}"
        elif column < _BESIDE:
            name, text = COMPONENTS[column - _WORDS.start + STATUS], str(int(value))
        else:
            name, text = COMPONENTS[column - _BESIDE + EXTERNAL], repr(value)
        parts.append(f"{name} {text}")
    return ("{" + ",".join(parts) + "}").encode("ascii")


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


def _turn(rotation: Array, printed: Array) -> Array:
    printed = np.ascontiguousarray(printed)
    renew_abc(np.ascontiguousarray(rotation), np.arange(len(rotation)), printed, DEG)
    return printed


_FORM: Final = TargetForm(
    printed=PrintedForm(length=MM, turns=3, turn=_turn, axis=DEG, unit="mm, deg"),
    enough=np.array([[_ENOUGH] * 6 + [99] * 8] * 2),
    least=np.array([[_LEAST] * 6 + [-1] * 8] * 2),
    words=_WORDS,
    count_decimals=_count_written,
    print_target=_print_target,
    respell_odd=_respell_odd,
    tidy=True,
)
