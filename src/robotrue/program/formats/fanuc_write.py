"""Splices new numbers into the bytes of a Fanuc LS file; every other byte is copied.

Numbers keep their style and, where the blanks before them allow, their column; they get at least
three decimals. In CONFIG only the letters and turns that change are replaced.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.program.formats.fanuc_offsets import MoveTarget
from robotrue.program.formats.fanuc_scan import FanucScan
from robotrue.program.formats.move_trail import line_end, line_start
from robotrue.program.formats.number_text import Stretch, restyle, splice_texts
from robotrue.program.formats.path_kernels import decimals_of
from robotrue.program.formats.pose_write import (
    changed_rows,
    find_moved,
    new_words,
    require_printable,
    spans_of,
)
from robotrue.program.formats.target_tokens import LEAST_DECIMALS, POSE, TargetTokens, rewritten
from robotrue.program.program import Program, Replacement

_TURN: Final = rb"([+-]?\d{1,2})\s*"
_CONFIG: Final = re.compile(
    rb"\s*([NF])\s*([UD])\s*([TB])\s*,\s*" + rb",\s*".join([_TURN] * 3), re.IGNORECASE
)
_LETTERS: Final = ("NF", "DU", "BT")
"""Letter of 0 and of 1 for the first three words."""


_MOST_DECIMALS: Final = 9
"""Of a number in a new record, which has as many as the others."""
_NAME: Final = re.compile(rb"\s*P\s*\[[^\]]*\]", re.IGNORECASE)
_CLOSE: Final = re.compile(rb"\}\s*;[ \t]*(?:\r\n|\n|\r)?")
MOST: Final = 32_766
"""Highest number of a position."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FanucSpans:
    """Places of the numbers.

    Attributes:
        tokens: The six numbers of each position.
        scan: The records, the first rows of the program.
        written: Targets of the rows after them, which get separate records.
    """

    tokens: TargetTokens
    scan: FanucScan
    written: tuple[MoveTarget, ...] = ()


def read_config(text: bytes) -> tuple[list[int], list[tuple[int, int]]] | None:
    """Returns the six words of CONFIG's text and their places, if it has this form."""
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
    spans = spans_of(program, FanucSpans, "fanuc_ls")
    words = np.where(new_words(program, replacement), replacement.words, NO_WORD)
    others = _write_out(program, replacement, spans, words)
    for row in np.flatnonzero((words[: len(spans.scan.place)] != NO_WORD).any(axis=1)).tolist():
        others += config_edits(program.data, spans.scan.config[row].tolist(), words[row].tolist())
    return rewritten(program, replacement, spans.tokens, others, aligned=True)


def config_edits(data: bytes, place: Sequence[int], words: Sequence[int]) -> list[Stretch]:
    """Returns the edits that write new words into CONFIG; none where its text is of unknown form.

    Args:
        data: Bytes that contain it.
        place: First byte and length of its text, -1 where there is none.
        words: The six; ``NO_WORD`` stays.
    """
    first, size = place
    known = read_config(data[first : first + size]) if first >= 0 else None
    return (
        [
            (first + begin, end - begin, _spell_word(column, word))
            for column, (word, (begin, end)) in enumerate(zip(words, known[1], strict=True))
            if word != NO_WORD
        ]
        if known
        else []
    )


def _write_out(
    program: Program, replacement: Replacement, spans: FanucSpans, words: IntArray
) -> list[Stretch]:
    """Returns the edits of targets with separate rows: their names, and new records.

    One that is left alone gets a record, too, where the record it names is changed for others.
    """
    if not spans.written:
        return []
    changed = changed_rows(program, replacement)
    place, turn, axes = find_moved(program, replacement)
    posed = spans.tokens.kind == POSE
    moved = changed & np.where(posed, place.any(axis=1) | turn, axes.any(axis=1))
    moved |= (words != NO_WORD).any(axis=1)
    out: list[Stretch] = []
    records: list[bytes] = []
    highest = spans.scan.highest
    for row, target in enumerate(spans.written, len(spans.scan.place)):
        if not (moved[row] or (target.row >= 0 and moved[target.row])):
            continue
        number = highest + len(records) + 1
        if number > MOST:
            raise ShapeError(f"P[{number}] is no position: numbers end at {MOST}.")
        values = _values_of(program, replacement, spans, row, changed=bool(moved[row]))
        records.append(_record(program, spans, row, number, values, words[row].tolist()))
        out += [(first, end - first, b"P[%d]" % number) for first, end in target.spans]
    if records:
        out.append((behind_records(program.data, spans.scan.last_record), 0, b"".join(records)))
    return out


def _values_of(
    program: Program, replacement: Replacement, spans: FanucSpans, row: int, *, changed: bool
) -> Array:
    """Returns the six numbers of a target, as printed."""
    tokens = spans.tokens
    if not changed:
        return np.asarray(tokens.value[row])
    if tokens.kind[row] != POSE:
        return np.asarray(replacement.axes[row]) / DEG
    near = tokens.value[row, :2:-1] * DEG
    turned = abc_from_matrix(np.asarray(replacement.rotation[row]), near=near) / DEG
    values = np.concatenate([np.asarray(replacement.position[row]) / MM, turned[::-1]])
    require_printable(program, values[None], np.ones((1, 6), np.bool_), "mm or deg")
    return values


def _record(
    program: Program, spans: FanucSpans, row: int, number: int, values: Array, words: list[int]
) -> bytes:
    """Returns the record of a target: a copy of the one its moves name, or of a register."""
    target, data, tokens = spans.written[row - len(spans.scan.place)], program.data, spans.tokens
    if target.pose is not None:
        config = target.pose.config
        config = splice_texts(config, config_edits(config, (0, len(config)), words))
        shown = decimals_of(np.frombuffer(data, np.uint8), tokens.start, tokens.length)
        decimals = np.clip(shown.max(axis=0, initial=0), LEAST_DECIMALS, _MOST_DECIMALS).tolist()
        return print_record(
            number, values.tolist(), decimals, target.in_force, config, line_end(data)
        )
    model = target.row
    edits = config_edits(data, spans.scan.config[model].tolist(), words)
    starts, sizes = tokens.start[model].tolist(), tokens.length[model].tolist()
    for start, length, value in zip(starts, sizes, values.tolist(), strict=True):
        token = data[start : start + length]
        edits.append((start, length, restyle(token, value, least=LEAST_DECIMALS)))
    return copy_record(data, int(spans.scan.place[model]), starts[5], number, edits)


def _spell_word(column: int, value: int) -> bytes:
    """Returns a word of CONFIG as it is printed: a letter, or a turn."""
    return (_LETTERS[column][value] if column < 3 else str(value)).encode()


def copy_record(data: bytes, place: int, last: int, number: int, edits: Sequence[Stretch]) -> bytes:
    """Returns a copy of a record with another number.

    Args:
        data: The file.
        place: A byte of the first line of the record.
        last: First byte of its last number.
        number: Of the copy.
        edits: What else differs, by its place in the record.
    """
    begin = line_start(data, place)
    before = data[begin : place + 1].upper().rpartition(b"P")[0]
    begin += len(before) if before.strip() else 0  # another record ends in this line
    close = _CLOSE.search(data, last)
    end = close.end() if close else len(data)
    head = _NAME.match(data, begin)
    name = (begin, head.end() - begin if head else 0, b"P[%d]" % number)
    inside = [(first - begin, size, text) for first, size, text in (name, *edits)]
    copy = splice_texts(data[begin:end], inside)
    return copy if copy.endswith((b"\n", b"\r")) else copy + b"\n"


def print_record(
    number: int,
    values: Sequence[float],
    decimals: Sequence[int],
    frames: tuple[int, int],
    config: bytes,
    end: bytes,
) -> bytes:
    """Returns a record of a pose.

    Args:
        number: Its number.
        values: X Y Z in mm, W P R in deg.
        decimals: Of each.
        frames: Numbers of its user frame and tool.
        config: Text in the quotes of CONFIG.
        end: How lines end.
    """
    x, y, z, w, p, r = (
        f"{value + 0.0:9.{most}f}".encode() for value, most in zip(values, decimals, strict=True)
    )
    return end.join(
        [
            b"P[%d]{" % number,
            b"   GP1:",
            b"\tUF : %d, UT : %d,\t\tCONFIG : '%s'," % (*frames, config),
            b"\tX = %s  mm,\tY = %s  mm,\tZ = %s  mm," % (x, y, z),
            b"\tW = %s deg,\tP = %s deg,\tR = %s deg" % (w, p, r),
            b"};",
            b"",
        ]
    )


def behind_records(data: bytes, last: int) -> int:
    """Returns the byte after the record that has a number, or its head, at a place."""
    close = _CLOSE.search(data, last)
    return close.end() if close else last
