"""Splices new numbers into the bytes of a JBI job; every other byte is copied.

Numbers keep their style; millimetres and degrees get at least three decimals, pulses none. RCONF is
modal: a point whose configuration changes gets a separate ``///RCONF`` line before it, and the next
point one with the previous value. These are the only bytes added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arm_words import WORDS
from robotrue.core.arrays import IntArray
from robotrue.program.formats.jbi_scan import JbiScan
from robotrue.program.formats.pose_write import new_words, spans_of
from robotrue.program.formats.target_tokens import TargetTokens, rewritten
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.program import Program, Replacement


@dataclass(frozen=True, slots=True, kw_only=True)
class JbiSpans:
    """Places of the numbers, and the RCONF in force.

    Attributes:
        tokens: The six numbers of each point.
        rconf: (n,) index into ``scan.rconf``, -1 where none holds.
        scan: The points, rows of the program.
    """

    tokens: TargetTokens
    rconf: IntArray
    scan: JbiScan


def write_jbi(program: Program, replacement: Replacement) -> bytes:
    """Returns the job with the numbers of the changed rows replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm, deg or pulses.
    """
    spans = spans_of(program, JbiSpans, "jbi")
    headers = _headers(program, replacement, spans)
    return rewritten(program, replacement, spans.tokens, headers, aligned=False)


def _headers(
    program: Program, replacement: Replacement, spans: JbiSpans
) -> list[tuple[int, int, bytes]]:
    """Returns (place, 0, line) of every RCONF line to insert."""
    new = new_words(program, replacement)
    wanted = np.where(new, replacement.words, program.words)
    if np.array_equal(wanted, program.words):
        return []
    rows = np.flatnonzero(spans.rconf >= 0)
    held = program.words[rows].copy()  # what holds before each row in the file as it will be
    follows = np.flatnonzero(spans.rconf[rows][1:] == spans.rconf[rows][:-1]) + 1
    held[follows] = wanted[rows[follows - 1]]
    out, starts = [], line_starts(program.data)
    for row in rows[(held != wanted[rows]).any(axis=1)].tolist():
        fields = spans.scan.rconf[int(spans.rconf[row])][WORDS["yaskawa"] :]
        text = ",".join(map(str, (*wanted[row].tolist(), *fields)))
        place = int(starts[spans.scan.line[row] - 1])
        out.append((place, 0, b"///RCONF " + text.encode() + _line_end(program.data, place)))
    return out


def _line_end(data: bytes, start: int) -> bytes:
    """Returns how the line before ``start`` ends."""
    if data[:start].endswith(b"\r\n"):
        return b"\r\n"
    return data[start - 1 : start]
