"""Sentences other rooms record in English (doubts, notes), in Chinese where they are known.

What is not known stays as it was recorded: a reader would rather have it in English than not.
"""

from __future__ import annotations

import re
from typing import Final

_PATTERNS: Final[tuple[tuple[str, str], ...]] = ()
_COMPILED: Final = tuple((re.compile(pattern), meant) for pattern, meant in _PATTERNS)


def in_chinese(sentence: str) -> str:
    """Returns the sentence in Chinese, or as it stands."""
    for pattern, meant in _COMPILED:
        found = pattern.fullmatch(sentence)
        if found is not None:
            return found.expand(meant)
    return sentence
