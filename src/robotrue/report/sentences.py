"""Sentences other rooms record in English (warnings, cures, notes), in Chinese where known.

An unknown sentence stays as it was recorded: a reader would rather have it in English than not.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Final

FILE: Final = Path(__file__).parent / "languages" / "sentences_zh.toml"
_PLACE: Final = re.compile(r"\\\{(?P<name>n[1-9]|[a-z])\\\}")


@cache
def _sentences() -> tuple[tuple[re.Pattern[str], str], ...]:
    """Returns the pattern of each English sentence and the Chinese text with its places."""
    pairs = tomllib.loads(FILE.read_text(encoding="utf-8"))["sentence"]
    return tuple((_pattern(pair["en"]), pair["zh"]) for pair in pairs)


def _pattern(english: str) -> re.Pattern[str]:
    """Returns what matches a sentence, its last full stop or none."""

    def group(place: re.Match[str]) -> str:
        name = place["name"]
        return rf"(?P<{name}>-?[\d.]+)" if name.startswith("n") else rf"(?P<{name}>.*?)"

    return re.compile(_PLACE.sub(group, re.escape(english.removesuffix("."))) + r"\.?")


def in_chinese(sentence: str) -> str:
    """Returns the sentence in Chinese, part by part where several are known, or as it stands."""
    for pattern, chinese in _sentences():
        match = pattern.fullmatch(sentence)
        if match is None:
            continue
        changed = chinese.format(**match.groupdict())
        return in_chinese(changed) if changed != sentence else sentence
    return sentence
