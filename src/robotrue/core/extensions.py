"""Extensions that other packages register by entry points."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import TypeVar

from robotrue.errors import ConfigurationError

T = TypeVar("T")


def load_extensions(group: str, kind: type[T]) -> Iterator[tuple[str, T]]:
    """Yields what each entry point of a group names, with its place in code, by name.

    Raises:
        ConfigurationError: One that cannot be imported, or is no ``kind``.
    """
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        try:
            found = entry.load()
        except Exception as cause:  # code of a third party
            raise refuse_extension(group, entry.value, f"cannot be imported: {cause}") from cause
        if not isinstance(found, kind):
            named = getattr(found, "__name__", type(found).__name__)
            raise refuse_extension(group, entry.value, f"is {named}, expected a {kind.__name__}")
        yield entry.value, found


def extension_files(group: str) -> list[Path]:
    """Returns the TOML files in the folders that a group names, by name.

    Raises:
        ConfigurationError: An entry point that names no folder.
    """
    files: list[Path] = []
    for value, folder in load_extensions(group, Path):
        if not folder.is_dir():
            raise refuse_extension(group, value, f"is {folder}, expected a folder of TOML files")
        files += sorted(folder.glob("*.toml"))
    return files


def refuse_extension(group: str, value: str, why: str) -> ConfigurationError:
    """Returns the error about one entry point.

    Args:
        group: Of the entry point.
        value: The place in code that it names.
        why: What is wrong with it.
    """
    return ConfigurationError(
        f"entry point {value!r} of {group} {why}.", hint="update or remove its package."
    )
