"""Position records of a Fanuc LS program that are written anew: copies of others, or new ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from robotrue.program.formats.move_trail import line_start
from robotrue.program.formats.number_text import Stretch, splice_texts

_NAME: Final = re.compile(rb"\s*P\s*\[[^\]]*\]")
_CLOSE: Final = re.compile(rb"\}\s*;[ \t]*(?:\r\n|\n|\r)?")
MOST: Final = 32_766
"""Highest number of a position."""


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
    close = _CLOSE.search(data, last)
    end = close.end() if close else len(data)
    head = _NAME.match(data, begin)
    name = (begin, head.end() - begin if head else 0, b"P[%d]" % number)
    inside = [(first - begin, size, text) for first, size, text in (name, *edits)]
    return splice_texts(data[begin:end], inside)


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
    """Returns the byte behind the record that has a number, or its head, at a place."""
    close = _CLOSE.search(data, last)
    return close.end() if close else last
