"""The words of a report in the reader's language: one catalog a language, the same keys in each.

Content is built with :class:`ReportTexts`; figures and pages take theirs from its ``lang``.
Machine-readable names (JSON) are English in every language.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from robotrue.core.catalogue import read_catalogue
from robotrue.errors import ConfigurationError
from robotrue.report.sentences import in_chinese

Lang: TypeAlias = Literal["en", "zh"]
"""``en`` English, ``zh`` simplified Chinese."""
FOLDER: Final = Path(__file__).parent / "languages"
LANGUAGES: Final[tuple[Lang, ...]] = ("en", "zh")
CATALOGS: Final[Mapping[Lang, Mapping[str, str]]] = {
    lang: read_catalogue([FOLDER / f"{lang}.toml"]) for lang in LANGUAGES
}
HTML_LANG: Final[Mapping[Lang, str]] = {"en": "en", "zh": "zh-CN"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTexts:
    """The catalog of one language.

    Attributes:
        lang: Which.
    """

    lang: Lang = "en"

    def __call__(self, key: str, **values: object) -> str:
        """Returns the text of a key with its values put in.

        Raises:
            ConfigurationError: A key no catalog has, or a value its text asks for is missing.
        """
        try:
            return CATALOGS[self.lang][key].format(**values)
        except (KeyError, IndexError) as cause:
            raise ConfigurationError(
                f"report text {key!r} ({self.lang}) cannot be written: {cause!r}."
            ) from cause

    def sentence(self, recorded: str) -> str:
        """Returns a sentence other rooms wrote in English, in this language where it is known."""
        return in_chinese(recorded) if self.lang == "zh" else recorded


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
