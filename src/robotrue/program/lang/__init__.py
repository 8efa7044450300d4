"""The program languages robotrue reads: one leaf file here for each, and one word below.

A leaf file holds a :class:`~robotrue.program.language.Language` as ``LANGUAGE``. A package outside
registers its own by an entry point of the group ``robotrue.languages`` that names such an object.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from robotrue.core.extensions import load_extensions, refuse_extension
from robotrue.errors import ConfigurationError
from robotrue.program.language import Language

if TYPE_CHECKING:
    from collections.abc import Mapping

    from robotrue.program.insertion import Inserter

LEAVES: Final = (
    "krl",
    "rapid",
    "fanuc_ls",
    "jbi",
    "urscript",
    "apt_program",
    "sinumerik",
    "fanuc_gcode",
    "heidenhain",
    "csv_program",
    "val3",
)
"""Files of this folder, in the order in which messages name their forms."""
GROUP: Final = "robotrue.languages"
"""Entry points of packages outside."""


@cache
def languages() -> Mapping[str, Language]:
    """Returns the languages by name, those of robotrue first.

    Raises:
        ConfigurationError: A package outside registers what is no language, or a name twice.
    """
    own = [import_module(f"{__name__}.{leaf}").LANGUAGE for leaf in LEAVES]
    known: dict[str, Language] = {language.name: language for language in own}
    for value, language in load_extensions(GROUP, Language):
        if language.name in known:
            raise refuse_extension(GROUP, value, f"is a second language {language.name!r}")
        known[language.name] = language
    return MappingProxyType(known)


def language_names() -> tuple[str, ...]:
    """Returns the registered names, sorted."""
    return tuple(sorted(languages()))


def find_language(name: str) -> Language:
    """Returns a language by its name.

    Raises:
        ConfigurationError: No language has this name.
    """
    known = languages()
    if name not in known:
        raise ConfigurationError(
            f"no dialect is called {name!r}.", hint=f"one of {', '.join(language_names())}."
        )
    return known[name]


def find_inserter(name: str) -> Inserter:
    """Returns the inserter of targets into programs of a language.

    Raises:
        ConfigurationError: There is no way to do so.
    """
    make = languages()[name].inserter if name in languages() else None
    if make is None:
        able = sorted(each.name for each in languages().values() if each.inserter)
        raise ConfigurationError(
            f"moves of a {name} program are not split; robotrue splits those of "
            f"{', '.join(able) or 'no dialect'}.",
            hint="leave --split away.",
        )
    return make()
