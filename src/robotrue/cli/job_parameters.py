"""What is asked of a job, read from its parameters and checked."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, TypeVar

from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import Noun
from robotrue.store.records import Record
from robotrue.store.workspace import Workspace

R = TypeVar("R", bound=Record)


class Parameters:
    """The parameters of one job.

    Items are meant by id, by the beginning of one, by name, or by ``{"id": ..., "version": ...}``;
    without a version it is the latest when the job begins.
    """

    def __init__(
        self, workspace: Workspace, stated: Mapping[str, Any], known: Collection[str]
    ) -> None:
        unknown = sorted(set(stated) - set(known))
        if unknown:
            raise ConfigurationError(
                f"unknown parameter {unknown[0]!r}; known are {', '.join(sorted(known))}."
            )
        self._workspace, self._stated = workspace, stated

    def text(self, name: str, default: str) -> str:
        """Returns a text."""
        value = self._stated.get(name, default)
        if not isinstance(value, str):
            raise _wrong(name, value, "text")
        return value

    def number(self, name: str, default: float) -> float:
        """Returns a number."""
        value = self._stated.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(name, value, "a number")
        return float(value)

    def number_or_none(self, name: str) -> float | None:
        """Returns a number, None where nothing is stated."""
        return None if self._stated.get(name) is None else self.number(name, 0.0)

    def flag(self, name: str, default: bool) -> bool:
        """Returns true or false."""
        value = self._stated.get(name, default)
        if not isinstance(value, bool):
            raise _wrong(name, value, "true or false")
        return value

    def item(self, noun: Noun[R], name: str) -> R:
        """Returns the item that is meant.

        Raises:
            ConfigurationError: None is stated, or it is not in the workspace, or deleted.
        """
        found = self.item_or_none(noun, name)
        if found is None:
            raise ConfigurationError(
                f"the parameter {name!r} is missing: which {noun.name}?",
                hint="robotrue workspace list shows what there is.",
            )
        return found

    def item_or_none(self, noun: Noun[R], name: str) -> R | None:
        """Returns the item that is meant, None where none is stated."""
        value = self._stated.get(name)
        return None if value is None else self._meant(noun, name, value)

    def _meant(self, noun: Noun[R], name: str, value: Any) -> R:
        version = None
        if isinstance(value, Mapping):
            value, version = value.get("id"), value.get("version")
        if not isinstance(value, str) or not (version is None or isinstance(version, int)):
            raise _wrong(name, value, f"the id of a {noun.name}")
        _, id = items.resolve(self._workspace, value, noun.name)
        found = items.get(self._workspace, noun, id, version=version)
        if found.deleted:
            raise ConfigurationError(
                f"{noun.name} {found.name!r} is deleted.", hint=f"robotrue workspace undo {id[:8]}"
            )
        return found


def _wrong(name: str, value: Any, expected: str) -> ConfigurationError:
    return ConfigurationError(f"parameter {name!r} is {value!r}, expected {expected}.")
