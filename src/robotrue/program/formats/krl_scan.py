"""One pass over the bytes of a KRL file: lines, aggregates, and the place of each number.

The scanner detects only lexical elements: comments (``;``), strings, ``&`` headers, braces, and the
aggregates ``{[TYPE:] X 1.0,Y 2.0,...}`` whose members are position, axis, status or turn
components. Results are columns, without an object per number. The meaning of a line is read in
``krl_walk``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, Bytes, Integers, Ints
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.errors import FormatError
from robotrue.program.formats.krl_tokens import aggregate, blank, find, word

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
    3: ("an unreadable number.", "write it as -12.345 or 1.5E-03."),
    4: ("a component that occurs twice in one aggregate.", "remove one of the two."),
    5: ("a based integer that is not closed.", "write it as 'B0110' or 'H1F'."),
}
_PIECE: Final = 1 << 18
"""Bytes counted at a time: what is compared then stays in the nearer caches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Places of the contents of one file; all offsets count bytes from its start.

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

    Args:
        data: The bytes.
        name: Of the file, for messages.

    Raises:
        FormatError: An unbalanced brace, or a number that cannot be read.
    """
    lines, braces, tokens = _room(data)
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
        begin = int(line_start[n_lines])
        message, hint = _ERRORS[error]
        text = data[begin : line_end[n_lines]].decode("latin-1").strip()
        message = f"column {place - begin + 1}: {message} The line is {text[:60]!r}."
        raise FormatError(message, source=name, line=n_lines + 1, hint=hint)
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


def _room(data: bytes) -> tuple[int, int, int]:
    """Returns upper bounds for lines, aggregates and tokens."""
    counts = np.zeros(4, np.int64)
    for at in range(0, len(data), _PIECE):
        text = np.frombuffer(data, np.uint8, min(_PIECE, len(data) - at), at)
        counts += [np.count_nonzero(text == ord(sign)) for sign in "\n\r{,"]
    feeds, returns, braces, commas = counts.tolist()
    return feeds + returns + 1, braces, braces + commas


@compile_kernel(PLAIN)
def _line_ends(buf: Bytes, i: int) -> tuple[int, int]:
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


@compile_kernel(PLAIN)
def _scan(
    buf: Bytes,
    i: int,
    motion_keys: Integers,
    motion_kinds: Integers,
    type_keys: Integers,
    component_keys: Integers,
    line_start: Integers,
    line_end: Integers,
    line_kind: Integers,
    agg_line: Integers,
    agg_open: Integers,
    agg_close: Integers,
    agg_flag: Integers,
    agg_token: Integers,
    tok_component: Integers,
    tok_start: Integers,
    tok_length: Integers,
    tok_value: Array,
) -> tuple[int, int, int, int, int]:
    """Fills the columns; returns (lines, aggregates, tokens, error, place of the error)."""
    n = buf.size
    n_line, n_agg, n_tok = 0, 0, 0
    while i < n:
        end, stop = _line_ends(buf, i)
        line_start[n_line], line_end[n_line] = i, end
        j = blank(buf, i, end)
        kind = 0 if j >= end or buf[j] == 38 else 1
        motion = 0
        if kind == 1:
            key, k = word(buf, j, end)
            found = find(motion_keys, key)
            k = blank(buf, k, end)
            if found >= 0 and k < end and buf[k] == 123:
                motion = motion_kinds[found]
                j = k
        # ``wanted`` counts the aggregates a plain motion still needs; -1: not plain.
        wanted = 0 if motion == 0 else (2 if motion == 5 else 1)
        depth, string = 0, False
        while kind == 1 and j < end:
            c = buf[j]
            if c == 34:
                string = not string
            elif string:
                pass
            elif c == 123:
                close, n_tok_new, flag, error, place = aggregate(
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
                        k = blank(buf, close + 1, end)
                        wanted -= 1
                        if wanted == 1 and (k >= end or buf[k] != 44):
                            wanted = -1
                        elif wanted == 1:
                            k = blank(buf, k + 1, end)
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
