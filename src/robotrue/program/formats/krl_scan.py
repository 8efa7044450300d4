"""One pass over the bytes of a KRL file: lines, aggregates, and where each number stands.

The scanner knows only what bytes tell: comments (``;``), strings, ``&`` headers, braces, and the
aggregates ``{[TYPE:] X 1.0,Y 2.0,...}`` whose members are position, axis, status or turn
components. Everything it finds is a column; nothing is an object per number. What a line means is
read in ``krl_walk``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array
from robotrue.errors import FormatError

COMPONENTS: Final = (
    *("X", "Y", "Z", "A", "B", "C"),
    *("A1", "A2", "A3", "A4", "A5", "A6"),
    *("E1", "E2", "E3", "E4", "E5", "E6"),
    *("S", "T"),
)
"""Component names by code: 0..5 pose (mm, deg), 6..11 axes (deg), 12..17 external, 18 S, 19 T."""
POSE: Final = 0
AXIS: Final = 6
EXTERNAL: Final = 12
STATUS: Final = 18
TURN: Final = 19

EMPTY: Final = 0
STATEMENT: Final = 1
"""A line that must be read as text; the kinds above it are motions to plain inline aggregates."""
INLINE_PTP: Final = 2
INLINE_LIN: Final = 3
INLINE_SPLINE: Final = 4
INLINE_ARC: Final = 5

NOT_CONSTANT: Final = 1
"""Aggregate flag: a member is an expression."""

_MOTIONS: Final = {
    "PTP": INLINE_PTP,
    "SPTP": INLINE_PTP,
    "LIN": INLINE_LIN,
    "SLIN": INLINE_LIN,
    "SPL": INLINE_SPLINE,
    "CIRC": INLINE_ARC,
    "SCIRC": INLINE_ARC,
}
_TYPES: Final = ("POS", "E6POS", "FRAME", "AXIS", "E6AXIS")
_ERRORS: Final = {
    1: (
        "'{' without its '}' on the same line: the aggregate is cut off.",
        "KRL keeps a statement on one line; export the program again, or close the brace.",
    ),
    2: ("'}' without a '{' before it on this line.", "export the program again."),
    3: ("a number that cannot be read.", "write it as -12.345 or 1.5E-03."),
    4: ("a component that stands twice in one aggregate.", "remove one of the two."),
    5: ("a based integer that is not closed.", "write it as 'B0110' or 'H1F'."),
}
_POW10: Final = np.array([10.0**k for k in range(23)])

Ints = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What stands where in one file; all offsets count bytes from its start.

    Attributes:
        data: The bytes.
        line_start: (l,) first byte of each line.
        line_end: (l,) end of its code, before a comment or line end.
        line_kind: (l,) ``EMPTY``, ``STATEMENT`` or an ``INLINE_`` motion.
        agg_line: (a,) zero-based line of each aggregate.
        agg_open: (a,) its opening brace.
        agg_close: (a,) its closing brace.
        agg_flag: (a,) ``NOT_CONSTANT`` or 0.
        agg_token: (a + 1,) first token of each aggregate.
        tok_component: (t,) index into ``COMPONENTS``.
        tok_start: (t,) first byte of the value.
        tok_length: (t,) its bytes.
        tok_value: (t,) as printed: mm, deg, or the integer of S and T.
    """

    data: bytes
    line_start: Ints
    line_end: Ints
    line_kind: Bytes
    agg_line: Ints
    agg_open: Ints
    agg_close: Ints
    agg_flag: Bytes
    agg_token: Ints
    tok_component: Bytes
    tok_start: Ints
    tok_length: npt.NDArray[np.uint16]
    tok_value: Array

    def code(self, line: int) -> str:
        """Returns the code of a zero-based line as text, without its comment."""
        return self.data[self.line_start[line] : self.line_end[line]].decode("latin-1")


def scan(data: bytes, *, name: str) -> Scan:
    """Returns the columns of a KRL file.

    Raises:
        FormatError: An unbalanced brace, or a number that cannot be read.
    """
    lines, braces, tokens = _room(np.frombuffer(data, np.uint8))
    line_start, line_end = np.empty(lines, np.int32), np.empty(lines, np.int32)
    line_kind = np.empty(lines, np.uint8)
    agg_line, agg_open, agg_close = (np.empty(braces, np.int32) for _ in range(3))
    agg_flag, agg_token = np.empty(braces, np.uint8), np.zeros(braces + 1, np.int32)
    tok_component, tok_start = np.empty(tokens, np.uint8), np.empty(tokens, np.int32)
    tok_length, tok_value = np.empty(tokens, np.uint16), np.empty(tokens)
    first = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    n_lines, n_agg, n_tok, error, place = _scan(
        np.frombuffer(data, np.uint8),
        first,
        *_MOTION_KEYS,
        _TYPE_KEYS,
        _COMPONENT_KEYS,
        line_start,
        line_end,
        line_kind,
        agg_line,
        agg_open,
        agg_close,
        agg_flag,
        agg_token,
        tok_component,
        tok_start,
        tok_length,
        tok_value,
    )
    if error:
        message, hint = _ERRORS[error]
        text = data[line_start[n_lines] : line_end[n_lines]].decode("latin-1").strip()
        column = place - int(line_start[n_lines]) + 1
        raise FormatError(
            f"column {column}: {message} The line is {text[:60]!r}.",
            source=name,
            line=n_lines + 1,
            hint=hint,
        )
    return Scan(
        data=data,
        line_start=line_start[:n_lines],
        line_end=line_end[:n_lines],
        line_kind=line_kind[:n_lines],
        agg_line=agg_line[:n_agg],
        agg_open=agg_open[:n_agg],
        agg_close=agg_close[:n_agg],
        agg_flag=agg_flag[:n_agg],
        agg_token=agg_token[: n_agg + 1],
        tok_component=tok_component[:n_tok],
        tok_start=tok_start[:n_tok],
        tok_length=tok_length[:n_tok],
        tok_value=tok_value[:n_tok],
    )


def _key(word: str) -> int:
    key = 0
    for letter in word:
        key = key * 64 + ord(letter) - 32
    return key


_MOTION_KEYS: Final = (
    np.array([_key(word) for word in _MOTIONS], np.int64),
    np.array(list(_MOTIONS.values()), np.uint8),
)
_TYPE_KEYS: Final = np.array([_key(word) for word in _TYPES], np.int64)
_COMPONENT_KEYS: Final = np.array([_key(word) for word in COMPONENTS], np.int64)


@numba.njit(cache=True)
def _room(buf: Any) -> Any:
    """Returns upper bounds for lines, aggregates and tokens."""
    ends, braces, commas = 0, 0, 0
    for i in range(buf.size):
        ends += (buf[i] == 10) + (buf[i] == 13)
        braces += buf[i] == 123
        commas += buf[i] == 44
    return ends + 1, braces, braces + commas


@numba.njit(cache=True)
def _blank(buf: Any, i: Any, end: Any) -> Any:
    """Returns the first place from ``i`` that is not a blank or tab."""
    while i < end and (buf[i] == 32 or buf[i] == 9):
        i += 1
    return i


@numba.njit(cache=True)
def _word(buf: Any, i: Any, end: Any) -> Any:
    """Returns (key, end) of the word at ``i``; key 0 if none, -1 if longer than ten letters."""
    key, j = 0, i
    while j < end:
        c = buf[j]
        if 97 <= c <= 122:
            c = c - 32
        if not (65 <= c <= 90 or 48 <= c <= 57 or c == 95):
            break
        key = key * 64 + c - 32
        j += 1
    if j - i > 10:
        key = -1
    return key, j


@numba.njit(cache=True)
def _find(keys: Any, key: Any) -> Any:
    for k in range(keys.size):
        if keys[k] == key:
            return k
    return -1


@numba.njit(cache=True)
def read_number(buf: Any, i: Any, end: Any) -> Any:
    """Returns (value, end) of ``[+-]?digits[.digits][ E[+-]digits]`` at ``i``; end = i if none."""
    j, negative = i, False
    if j < end and (buf[j] == 43 or buf[j] == 45):
        negative = buf[j] == 45
        j += 1
    mantissa, kept, digits, power = 0, 0, 0, 0
    point = False
    while j < end:
        c = buf[j]
        if 48 <= c <= 57:
            digits += 1
            if kept < 18:
                mantissa = mantissa * 10 + (c - 48)
                kept += mantissa > 0
                power -= point
            else:
                power += not point
        elif c == 46 and not point:
            point = True
        else:
            break
        j += 1
    if digits == 0:
        return 0.0, i
    k = _blank(buf, j, end)
    if k < end and (buf[k] == 69 or buf[k] == 101):
        k += 1
        down = False
        if k < end and (buf[k] == 43 or buf[k] == 45):
            down = buf[k] == 45
            k += 1
        exponent, first = 0, k
        while k < end and 48 <= buf[k] <= 57:
            exponent = min(exponent * 10 + (buf[k] - 48), 9999)
            k += 1
        if k > first:
            j = k
            power += -exponent if down else exponent
    value = float(mantissa)
    if -22 <= power < 0:
        value /= _POW10[-power]
    elif 0 <= power <= 22:
        value *= _POW10[power]
    else:
        value *= 10.0**power
    return (-value if negative else value), j


@numba.njit(cache=True)
def _based(buf: Any, i: Any, end: Any) -> Any:
    """Returns (value, end) of ``'B0110'`` or ``'H1F'`` at ``i``; end = i if it is neither."""
    if i + 3 >= end:
        return 0.0, i
    letter = buf[i + 1] & 223
    if letter != 66 and letter != 72:
        return 0.0, i
    value, base, j = 0, (2 if letter == 66 else 16), i + 2
    while j < end and buf[j] != 39:
        c = buf[j]
        digit = 99
        if 48 <= c <= 57:
            digit = c - 48
        elif 65 <= (c & 223) <= 70:
            digit = (c & 223) - 55
        if digit >= base or value >= 2**40:
            return 0.0, i
        value = value * base + digit
        j += 1
    if j >= end or j == i + 2:
        return 0.0, i
    return float(value), j + 1


@numba.njit(cache=True)
def _skip_value(buf: Any, i: Any, end: Any) -> Any:
    """Returns the ``,`` or ``}`` that ends an expression at ``i``, or ``end``."""
    depth = 0
    while i < end:
        c = buf[i]
        if c == 40 or c == 91 or c == 123:
            depth += 1
        elif depth > 0 and (c == 41 or c == 93 or c == 125):
            depth -= 1
        elif depth == 0 and (c == 44 or c == 125):
            return i
        i += 1
    return end


@numba.njit(cache=True)
def _aggregate(
    buf: Any,
    i: Any,
    end: Any,
    type_keys: Any,
    component_keys: Any,
    n_tok: Any,
    tok_component: Any,
    tok_start: Any,
    tok_length: Any,
    tok_value: Any,
) -> Any:
    """Reads the braces opening at ``i``.

    Returns (closing brace or -1 if it is no aggregate of components, tokens, flag, error, place).
    """
    j = _blank(buf, i + 1, end)
    key, k = _word(buf, j, end)
    after = _blank(buf, k, end)
    if after < end and buf[after] == 58:
        if _find(type_keys, key) < 0:
            return -1, n_tok, 0, 0, 0
        j = after + 1
    flag, seen = 0, 0
    while True:
        j = _blank(buf, j, end)
        key, k = _word(buf, j, end)
        code = _find(component_keys, key)
        if code < 0:
            return -1, n_tok, 0, 0, 0
        j = _blank(buf, k, end)
        if j < end and buf[j] == 123:
            return -1, n_tok, 0, 0, 0
        if seen & (1 << code):
            return -1, n_tok, 0, 4, j
        seen |= 1 << code
        start = j
        if j < end and buf[j] == 39:
            value, j = _based(buf, j, end)
            if j == start:
                return -1, n_tok, 0, 5, j
        else:
            value, j = read_number(buf, j, end)
        if not np.isfinite(value):
            return -1, n_tok, 0, 3, start
        after = _blank(buf, j, end)
        plain = j > start and after < end and (buf[after] == 44 or buf[after] == 125)
        if plain:
            tok_component[n_tok] = code
            tok_start[n_tok] = start
            tok_length[n_tok] = j - start
            tok_value[n_tok] = value
            n_tok += 1
        else:
            if j > start and j < end and (buf[j] == 46 or 48 <= buf[j] <= 57):
                return -1, n_tok, 0, 3, start
            flag = 1
            after = _skip_value(buf, j, end)
            if after >= end:
                return -1, n_tok, 0, 1, i
        if buf[after] == 125:
            return after, n_tok, flag, 0, 0
        j = after + 1


@numba.njit(cache=True)
def _line_ends(buf: Any, i: Any) -> Any:
    """Returns (end of code, end of line) of the line that starts at ``i``."""
    n = buf.size
    code, string, j = -1, False, i
    while j < n and buf[j] != 10 and buf[j] != 13:
        if buf[j] == 34:
            string = not string
        elif buf[j] == 59 and not string and code < 0:
            code = j
        j += 1
    return (j if code < 0 else code), j


@numba.njit(cache=True)
def _scan(
    buf: Any,
    i: Any,
    motion_keys: Any,
    motion_kinds: Any,
    type_keys: Any,
    component_keys: Any,
    line_start: Any,
    line_end: Any,
    line_kind: Any,
    agg_line: Any,
    agg_open: Any,
    agg_close: Any,
    agg_flag: Any,
    agg_token: Any,
    tok_component: Any,
    tok_start: Any,
    tok_length: Any,
    tok_value: Any,
) -> Any:
    """Fills the columns; returns (lines, aggregates, tokens, error, place of the error)."""
    n = buf.size
    n_line, n_agg, n_tok = 0, 0, 0
    while i < n:
        end, stop = _line_ends(buf, i)
        line_start[n_line], line_end[n_line] = i, end
        j = _blank(buf, i, end)
        kind = 0 if j >= end or buf[j] == 38 else 1
        motion = 0
        if kind == 1:
            key, k = _word(buf, j, end)
            found = _find(motion_keys, key)
            k = _blank(buf, k, end)
            if found >= 0 and k < end and buf[k] == 123:
                motion = motion_kinds[found]
                j = k
        # ``wanted`` counts the aggregates a plain motion still needs; -1 says it is not plain.
        wanted = 0 if motion == 0 else (2 if motion == 5 else 1)
        depth, string = 0, False
        while kind == 1 and j < end:
            c = buf[j]
            if c == 34:
                string = not string
            elif string:
                pass
            elif c == 123:
                close, n_tok_new, flag, error, place = _aggregate(
                    buf,
                    j,
                    end,
                    type_keys,
                    component_keys,
                    n_tok,
                    tok_component,
                    tok_start,
                    tok_length,
                    tok_value,
                )
                if error:
                    return n_line, n_agg, n_tok, error, place
                if close < 0:
                    depth += 1
                    wanted = -1
                else:
                    agg_line[n_agg], agg_open[n_agg] = n_line, j
                    agg_close[n_agg], agg_flag[n_agg] = close, flag
                    agg_token[n_agg] = n_tok
                    n_tok = n_tok_new
                    n_agg += 1
                    agg_token[n_agg] = n_tok
                    j = close
                    if depth == 0 and wanted > 0:
                        k = _blank(buf, close + 1, end)
                        wanted -= 1
                        if wanted == 1 and (k >= end or buf[k] != 44):
                            wanted = -1
                        elif wanted == 1:
                            k = _blank(buf, k + 1, end)
                            if k >= end or buf[k] != 123:
                                wanted = -1
                        elif k < end and (buf[k] & 223) != 67:  # C_DIS and its like
                            wanted = -1
                    else:
                        wanted = -1
            elif c == 125:
                depth -= 1
                if depth < 0:
                    return n_line, n_agg, n_tok, 2, j
            j += 1
        if depth > 0:
            return n_line, n_agg, n_tok, 1, end
        line_kind[n_line] = motion if motion > 0 and wanted == 0 else kind
        n_line += 1
        i = stop + 1
        if stop < n and buf[stop] == 13 and i < n and buf[i] == 10:
            i += 1
    return n_line, n_agg, n_tok, 0, 0
