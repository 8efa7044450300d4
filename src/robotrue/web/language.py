"""The words of the pages: a folder per language, in it a file per page and one for the shell.

Every language has the same keys.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

from robotrue.core.files import read_catalogue
from robotrue.errors import ConfigurationError

LANGUAGES: Final = {"en": "English", "zh": "中文"}
FOLDER: Final = Path(__file__).parent / "languages"


@cache
def words(language: str) -> dict[str, str]:
    """Returns all texts of a language by their dotted keys, e.g. ``"nav.cell"``.

    Raises:
        ConfigurationError: There is no such language.
    """
    if language not in LANGUAGES:
        raise ConfigurationError(f"language {language!r}, expected {', '.join(LANGUAGES)}.")
    return read_catalogue(sorted((FOLDER / language).glob("*.toml")))


class Wording:
    """Says a text of one language: ``say("programs.go", targets=30)``."""

    def __init__(self, language: str) -> None:
        self.language = language
        self._words = words(language)

    def __call__(self, key: str, **values: object) -> str:
        """Returns the text of a key with its values inserted.

        Raises:
            ConfigurationError: No such text; a test checks all that are used.
        """
        try:
            text = self._words[key]
        except KeyError:
            raise ConfigurationError(f"no text {key!r} in languages/{self.language}.") from None
        return text.format(**values) if values else text

    def word(self, group: str, name: str) -> str:
        """Returns the text of a name in a group; a name that is not known as it is."""
        key = f"{group}_{name.replace(' ', '_').replace('-', '_')}"
        return self._words.get(key, name)

    def group(self, name: str) -> dict[str, str]:
        """Returns all texts of a group by the remaining part of their keys, for scripts."""
        start = f"{name}."
        return {k.removeprefix(start): v for k, v in self._words.items() if k.startswith(start)}

    def has(self, key: str) -> bool:
        """Returns whether there is such a text."""
        return key in self._words


def choose_language(accept_language: str) -> str:
    """Returns the preferred language of a browser's ``Accept-Language``; English otherwise."""
    for part in accept_language.lower().split(","):
        tag = part.partition(";")[0].strip().partition("-")[0]
        if tag in LANGUAGES:
            return tag
    return "en"
