"""The words of a report in the reader's language: one catalog a language, the same keys in each.

Content is built with :class:`ReportTexts`; figures and pages take theirs from its ``lang``.
Machine-readable names (JSON) are English in every language.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, Literal, TypeAlias

from robotrue.core.files import DEFAULT_LANG, read_catalogue
from robotrue.errors import ConfigurationError

Lang: TypeAlias = Literal["en", "zh"]
"""``en`` English, ``zh`` simplified Chinese."""
FOLDER: Final = Path(__file__).parent / "languages"
LANGUAGES: Final[tuple[Lang, ...]] = ("en", "zh")
CATALOGS: Final[Mapping[Lang, Mapping[str, str]]] = {
    lang: read_catalogue([FOLDER / f"{lang}.toml"]) for lang in LANGUAGES
}
SENTENCES: Final = FOLDER / "sentences_zh.toml"
"""Sentences other rooms record in English (warnings, cures, notes), and the Chinese of each.

An unknown sentence stays as it was recorded: a reader would rather have it in English than not.
"""
_PLACE: Final = re.compile(r"\\\{(?P<name>n[1-9]|[a-z])\\\}")
_MICRO: Final = re.compile(r"(?<=\d )u(?=(?:m|rad)\b)")
HTML_LANG: Final[Mapping[Lang, str]] = {"en": "en", "zh": "zh-CN"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTexts:
    """The catalog of one language.

    Attributes:
        lang: Which.
    """

    lang: Lang = DEFAULT_LANG

    def __call__(self, key: str, **values: object) -> str:
        """Returns the text of a key with its values inserted.

        Raises:
            ConfigurationError: A key no catalog has, or a value that its text needs is missing.
        """
        try:
            return CATALOGS[self.lang][key].format(**values)
        except (KeyError, IndexError) as cause:
            raise ConfigurationError(
                f"report text {key!r} ({self.lang}) cannot be written: {cause!r}."
            ) from cause

    def sentence(self, recorded: str) -> str:
        """Returns a sentence other rooms wrote in English, in this language where it is known.

        Command lines print micrometres as ``um``, pages and reports as ``µm``.
        """
        return _MICRO.sub("µ", in_chinese(recorded) if self.lang == "zh" else recorded)


ENGLISH: Final = ReportTexts()


def language(name: str) -> Lang:
    """Returns the language of an option.

    Raises:
        ConfigurationError: Not one of :data:`LANGUAGES`.
    """
    if name not in LANGUAGES:
        raise ConfigurationError(
            f"no report language {name!r}; there are {', '.join(LANGUAGES)}.", hint="--lang zh"
        )
    return name


@cache
def _sentences() -> tuple[tuple[re.Pattern[str], str], ...]:
    """Returns the pattern of each English sentence and the Chinese text with its places."""
    pairs = tomllib.loads(SENTENCES.read_text(encoding="utf-8"))["sentence"]
    return tuple((_pattern(pair["en"]), pair["zh"]) for pair in pairs)


def _pattern(english: str) -> re.Pattern[str]:
    """Returns what matches a sentence, its last full stop or none."""

    def group(place: re.Match[str]) -> str:
        name = place["name"]
        return rf"(?P<{name}>-?[\d.]+)" if name.startswith("n") else rf"(?P<{name}>.*?)"

    return re.compile(_PLACE.sub(group, re.escape(english.removesuffix("."))) + r"\.?")


def in_chinese(sentence: str) -> str:
    """Returns the sentence in Chinese, part by part where several are known, else unchanged."""
    for pattern, chinese in _sentences():
        match = pattern.fullmatch(sentence)
        if match is None:
            continue
        changed = chinese.format(**match.groupdict())
        return in_chinese(changed) if changed != sentence else sentence
    return sentence
