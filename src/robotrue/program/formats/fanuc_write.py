"""Splices new numbers into the bytes of a Fanuc LS file; every other byte is copied.

Numbers keep the style and, where the blanks before them allow, the column they stand in; they get
at least three decimals. In CONFIG only the letters and turns that change are replaced.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import IntArray
from robotrue.errors import ShapeError
from robotrue.program.formats.pose_write import changed_rows
from robotrue.program.formats.target_tokens import TargetTokens, rewritten
from robotrue.program.program import Program, Replacement

_TURN: Final = rb"([+-]?\d{1,2})\s*"
_CONFIG: Final = re.compile(
    rb"\s*([NF])\s*([UD])\s*([TB])\s*,\s*" + rb",\s*".join([_TURN] * 3), re.IGNORECASE
)
_LETTERS: Final = ("NF", "DU", "BT")
"""Letter of 0 and of 1 for the first three words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FanucSpans:
    """Where the numbers stand.

    Attributes:
        tokens: The six numbers of each position.
        config: (n, 2) first byte and length of the text of CONFIG, -1 where there is none.
    """

    tokens: TargetTokens
    config: IntArray


def read_config(text: bytes) -> tuple[list[int], list[tuple[int, int]]] | None:
    """Returns the six words of CONFIG's text and where each stands in it, if it has this form."""
    match = _CONFIG.fullmatch(text)
    if match is None:
        return None
    spans = [match.span(i) for i in range(1, 7)]
    letters = [pair.index(match[i + 1].decode().upper()) for i, pair in enumerate(_LETTERS)]
    return letters + [int(match[i]) for i in (4, 5, 6)], spans


def write_fanuc(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the numbers of the changed rows replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    spans = program.spans
    if not isinstance(spans, FanucSpans):
        raise ShapeError(f"{program.name} was not read by the fanuc_ls dialect, but by another.")
    others = _configurations(program, replacement, spans)
    return rewritten(program, replacement, spans.tokens, others, aligned=True)


def _configurations(
    program: Program, replacement: Replacement, spans: FanucSpans
) -> list[tuple[int, int, bytes]]:
    """Returns (first byte, bytes, text) of the letters and turns of CONFIG that change."""
    changed = changed_rows(program, replacement)
    words = np.asarray(replacement.words, dtype=np.int64)
    new = changed[:, None] & (words != NO_WORD) & (program.words != NO_WORD)
    new &= words != program.words
    out: list[tuple[int, int, bytes]] = []
    for row in np.flatnonzero(new.any(axis=1)).tolist():
        first, size = spans.config[row].tolist()
        found = read_config(program.data[first : first + size])
        for column in np.flatnonzero(new[row]).tolist() if found else ():
            begin, end = found[1][column] if found else (0, 0)
            out.append((first + begin, end - begin, config_word(column, int(words[row, column]))))
    return out


def config_word(column: int, value: int) -> bytes:
    """Returns a word of CONFIG as it is printed: a letter, or a turn."""
    return (_LETTERS[column][value] if column < 3 else str(value)).encode()
