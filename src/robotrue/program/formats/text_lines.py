"""Lines of a program's bytes, and the refusal of bytes that are no text."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError

_LARGEST: Final = 2**31 - 1


def require_text(data: bytes, name: str) -> None:
    """Refuses what cannot be a program of one byte per character.

    Raises:
        FormatError: UTF-16, a NUL byte, or 2 GiB and more.
    """
    if len(data) >= _LARGEST:
        raise FormatError(
            f"{len(data)} bytes, at most {_LARGEST - 1} are read.",
            source=name,
            line=1,
            hint="split the program, as the controller needs it anyway.",
        )
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FormatError(
            "the file is UTF-16, programs are one byte per character.",
            source=name,
            line=1,
            hint="save it as ANSI (Latin-1) or UTF-8.",
        )
    zero = data.find(b"\0")
    if zero >= 0:
        raise FormatError(
            f"NUL byte at offset {zero}: a binary file, UTF-16 text, or a damaged copy.",
            source=name,
            line=line_at(data, zero),
            hint="export the program again as plain text.",
        )


def line_starts(data: bytes) -> IntArray:
    """Returns the first byte of every line (l,); lines end with LF, CR LF or CR."""
    text = np.frombuffer(data, np.uint8)
    feeds = np.flatnonzero(text == 10)
    returns = np.flatnonzero(text == 13)
    lone = returns[
        (returns + 1 >= len(text)) | (text[np.minimum(returns + 1, len(text) - 1)] != 10)
    ]
    ends = np.sort(np.concatenate([feeds, lone])) if len(lone) else feeds
    return np.concatenate([[0], ends + 1]).astype(np.int64)


def line_edges(data: bytes) -> IntArray:
    """Returns the first byte of every line, and the byte after the last (l + 1,)."""
    starts = line_starts(data)
    return np.append(starts[starts < len(data)], len(data))


def split_outside(text: str, sign: str) -> list[str]:
    """Returns the texts between the signs outside of brackets."""
    depth, start, out = 0, 0, []
    for at, letter in enumerate(text):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == sign and depth == 0:
            out.append(text[start:at])
            start = at + 1
    return [*out, text[start:]]


def line_at(data: bytes, place: int) -> int:
    """Returns the one-based line of a byte."""
    before = data[:place]
    return 1 + before.count(b"\n") + before.count(b"\r") - before.count(b"\r\n")
