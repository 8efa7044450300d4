"""The options of an address: ``name=value`` pairs, each known, each read with its unit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from urllib.parse import parse_qsl

from robotrue.errors import ConfigurationError


class AddressOptions:
    """Options after ``?``, refused where they are not known.

    Args:
        shown: The address as messages name it.
        options: As they stand there.
        known: What may stand there, and what it means.

    Raises:
        ConfigurationError: An option that is not known.
    """

    def __init__(self, shown: str, options: Mapping[str, str], known: Mapping[str, str]) -> None:
        self._shown = shown
        self._options = dict(options)
        self._known = known
        if unknown := sorted(set(options) - set(known)):
            raise ConfigurationError(
                f"option {', '.join(unknown)} is not known here, expected "
                + "; ".join(f"{name}= ({what})" for name, what in known.items())
                + ".",
                source=shown,
            )

    @staticmethod
    def of_path(address: str, known: Mapping[str, str]) -> tuple[str, AddressOptions]:
        """Returns the path of ``scheme://PATH?options``, as it stands, and its options.

        Raises:
            ConfigurationError: No path, options that are none, one twice, or one not known.
        """
        scheme, _, rest = address.partition("://")
        path, _, query = rest.partition("?")
        try:
            pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        except ValueError:
            pairs = []
        if not path or len(dict(pairs)) < len(pairs) or bool(query) != bool(pairs):
            raise ConfigurationError(
                "no path, or options that cannot be read.",
                source=address,
                hint=f"{scheme}://PATH?name=value&name=value",
            )
        return path, AddressOptions(f"{scheme}://{path}", dict(pairs), known)

    def has(self, name: str) -> bool:
        """Returns whether an option is stated."""
        return name in self._options

    def text(self, name: str) -> str | None:
        """Returns a value as it stands, None if it is not stated.

        Raises:
            ConfigurationError: It is stated and empty.
        """
        value = self._options.get(name)
        if value == "":
            raise self._wrong(name, "")
        return value

    def word(self, name: str, words: Sequence[str]) -> str | None:
        """Returns one of some words, None if it is not stated.

        Raises:
            ConfigurationError: Another word.
        """
        value = self._options.get(name)
        if value is not None and value not in words:
            raise self._wrong(name, value)
        return value

    def number(self, name: str, unit: str, *, default: float = math.nan) -> float:
        """Returns a number, with its unit or without, or the default.

        Raises:
            ConfigurationError: No finite number, or another unit.
        """
        text = self._options.get(name)
        if text is None:
            return default
        bare = text.strip()
        if unit and bare.endswith(unit):
            bare = bare[: -len(unit)].strip()
        try:
            value = float(bare)
        except ValueError:
            raise self._wrong(name, text) from None
        if not math.isfinite(value):
            raise self._wrong(name, text)
        return value

    def whole(self, name: str, unit: str, *, default: int) -> int:
        """Returns a whole number from 0, with its unit or without, or the default.

        Raises:
            ConfigurationError: No whole number from 0, or another unit.
        """
        value = self.number(name, unit, default=default)
        if value != int(value) or value < 0.0:
            raise self._wrong(name, self._options[name])
        return int(value)

    def _wrong(self, name: str, value: str) -> ConfigurationError:
        return ConfigurationError(
            f"{name}={value}, expected {self._known[name]}.", source=self._shown
        )
