"""Texts by dotted key, from TOML files: a catalogue of one language."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

DEFAULT_LANG: Final = "en"
"""Language of texts unless somebody asks for another."""


def read_catalogue(paths: Iterable[Path]) -> dict[str, str]:
    """Returns all texts of some files by their dotted keys, e.g. ``"nav.cell"``."""
    texts: dict[str, str] = {}
    for path in paths:
        texts |= _flatten(tomllib.loads(path.read_text(encoding="utf-8")), "")
    return texts


def _flatten(table: Mapping[str, object], prefix: str) -> dict[str, str]:
    texts: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            texts |= _flatten(value, f"{prefix}{key}.")
        else:
            texts[f"{prefix}{key}"] = str(value)
    return texts
