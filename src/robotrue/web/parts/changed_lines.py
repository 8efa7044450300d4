"""Lines of a program that compensation changed, with their old text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import islice, zip_longest
from pathlib import Path
from typing import Final, TypeAlias

from robotrue.app.serve_defaults import LARGEST_DRAWN

SHOWN: Final = 60
WINDOW: Final = 200
"""Lines of each file that are aligned at once; the files are read no further than that."""
Change: TypeAlias = tuple[int, str, str]
"""Number in the new file, the line as it was, the line as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedLines:
    """The first changed lines of a program.

    Attributes:
        rows: An inserted line has no text before, a removed one none after.
        whole: Whether the files were compared to their ends, or until enough lines were found.
    """

    rows: list[Change]
    whole: bool = True


def list_changed_lines(before: Path, after: Path, most_bytes: int = LARGEST_DRAWN) -> ChangedLines:
    """Returns the first changed lines; both files are read until enough are found.

    Args:
        before: The program as it was.
        after: The program as it is.
        most_bytes: Of ``after`` that are compared.
    """
    rows: list[Change] = []
    was: list[bytes] = []
    now: list[bytes] = []
    number = compared = 0
    with before.open("rb") as old, after.open("rb") as new:
        while len(rows) < SHOWN:
            was += islice(old, WINDOW - len(was))
            now += islice(new, WINDOW - len(now))
            if not was and not now:
                return ChangedLines(rows=rows)
            if compared > most_bytes:
                return ChangedLines(rows=rows, whole=False)
            used_was, used_now = len(was), len(now)
            if was != now:
                used_was, used_now, changes = _align(was, now)
                rows += ((number + k, text, changed) for k, text, changed in changes)
            number, compared = number + used_now, compared + sum(map(len, now[:used_now]))
            was, now = was[used_was:], now[used_now:]
    return ChangedLines(rows=rows[:SHOWN])


def _align(was: list[bytes], now: list[bytes]) -> tuple[int, int, list[Change]]:
    """Returns the number of compared lines of two windows, and their changes.

    Lines after the last equal ones wait for the next window, which may hold what they match.
    """
    matcher = SequenceMatcher(None, was, now, autojunk=False)
    blocks = [block for block in matcher.get_matching_blocks() if block.size]
    end_was, end_now = len(was), len(now)
    if blocks and max(end_was, end_now) == WINDOW:
        end_was, end_now = blocks[-1].a + blocks[-1].size, blocks[-1].b + blocks[-1].size
    codes = [code for code in matcher.get_opcodes() if code[0] != "equal"]
    changes: list[Change] = []
    for _, i, i_end, j, j_end in codes:
        if i < end_was or j < end_now:
            changes += _pair(was[i:i_end], now[j:j_end], j + 1)
    return end_was, end_now, changes


def _pair(was: list[bytes], now: list[bytes], first: int) -> Iterator[Change]:
    pairs = zip_longest(was, now, fillvalue=b"")
    for number, texts in enumerate(pairs, first):
        old, new = (text.decode("latin-1").rstrip("\r\n") for text in texts)
        yield number, old, new
