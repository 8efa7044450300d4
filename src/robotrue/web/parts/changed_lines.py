"""Lines of a program that compensation changed, beside the lines as they were."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import SequenceMatcher
from itertools import islice, zip_longest
from pathlib import Path
from typing import Final

SHOWN: Final = 60
MOST_COMPARED: Final = 3000
"""Lines of a program whose number of lines changed that are compared."""


def list_changed_lines(before: Path, after: Path) -> list[tuple[int, str, str]]:
    """Returns the first changed lines: number in the new file, as it was, as it is.

    A line that was inserted has no text before, one that was removed none after.
    """
    old, new = (path.read_text(encoding="latin-1").splitlines() for path in (before, after))
    return list(islice(_changes(old, new), SHOWN))


def _changes(old: list[str], new: list[str]) -> Iterator[tuple[int, str, str]]:
    if len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True), 1)
        yield from ((number, was, now) for number, (was, now) in pairs if was != now)
        return
    matcher = SequenceMatcher(None, old[:MOST_COMPARED], new[:MOST_COMPARED], autojunk=False)
    for kind, i, i_end, j, j_end in matcher.get_opcodes():
        if kind != "equal":
            for k, (was, now) in enumerate(zip_longest(old[i:i_end], new[j:j_end], fillvalue="")):
                yield j + k + 1, was, now
