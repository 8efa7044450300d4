"""Where the numbers of KRL targets stand, and the text of a target that is written out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, Bytes, IntArray, Ints
from robotrue.program.formats.krl_scan import COMPONENTS, EXTERNAL, STATUS
from robotrue.program.formats.path_kernels import decimals_of
from robotrue.program.formats.written_out import NONE_WRITTEN, WrittenOut

_LEAST: Final = np.repeat([4, 6, 5, 5, 0], 3)
_MOST: Final = 9
"""Decimals of what is written out, by component: as many as the file has, within these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KrlSpans:
    """Where the numbers of the targets stand.

    Attributes:
        token: (n,) first token of each target.
        tokens: (n,) how many it has.
        component: (t,) component code of every token of the file.
        start: (t,) its first byte.
        length: (t,) its bytes.
        value: (t,) its value as printed.
        is_axis: (n,) the target is an axis target.
        partial: (p,) rows with components left out that they inherit, in the order of motion.
        donor: (p, 6) the row each left-out component is inherited from, -1 if it is written.
        owed: (p, 6) left-out components that are inserted when the inherited value is not right.
        written: Rows that are written out.
        bound: (w,) a stored target they are computed from is moved to as well: they are written
            out with every change of the file.
    """

    token: Ints
    tokens: Ints
    component: Bytes
    start: Ints
    length: npt.NDArray[np.uint16]
    value: Array
    is_axis: BoolArray
    partial: IntArray
    donor: IntArray
    owed: BoolArray
    written: WrittenOut = NONE_WRITTEN
    bound: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))


def states_other_words(spans: KrlSpans, words: IntArray) -> BoolArray:
    """Returns the rows that are written out and get another S or T than they have, (n,)."""
    out = np.zeros(len(spans.token), np.bool_)
    for row in spans.written.row.tolist():
        first = int(spans.token[row])
        for token in range(first, first + int(spans.tokens[row])):
            code = int(spans.component[token])
            if code >= STATUS:
                word = int(words[row][code - STATUS])
                out[row] |= word >= 0 and word != int(spans.value[token])
    return out


def written_decimals(data: bytes, spans: KrlSpans) -> list[int]:
    """Returns with how many decimals each component is written out: the most the file has."""
    table = spans.start[:, None].astype(np.int64), spans.length[:, None].astype(np.int64)
    have = decimals_of(np.frombuffer(data, np.uint8), *table)[:, 0]
    most = _LEAST.copy()
    np.maximum.at(most, np.minimum(spans.component, EXTERNAL), have)
    return [int(number) for number in np.minimum(most, _MOST)]


def format_aggregate(
    spans: KrlSpans, tokens: range, values: Array, words: list[int], decimals: list[int]
) -> bytes:
    """Returns a target in braces: new pose or axes, the rest as it was."""
    parts = []
    for token in tokens:
        code, value = int(spans.component[token]), float(spans.value[token])
        if code < EXTERNAL:
            text = f"{values[code % 6] + 0.0:.{decimals[code]}f}"
        elif code < STATUS:
            text = repr(value)
        else:
            word = words[code - STATUS]
            text = str(int(value) if word < 0 else word)
        parts.append(f"{COMPONENTS[code]} {text}")
    return ("{" + ",".join(parts) + "}").encode("ascii")
