"""Column mappings written as TOML files."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from robotrue.core.toml_text import read_toml
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.mapping import ColumnMapping


def read_mapping(path: Path) -> ColumnMapping:
    """Returns a column mapping written as TOML: the fields of ``ColumnMapping``, nothing else.

    Raises:
        ConfigurationError: Not TOML, an unknown field or a value it cannot take.
        FormatError: The file cannot be read.
    """
    stated, _ = read_toml(path, example="the guide on importing a tracker file")
    known = {f.name for f in fields(ColumnMapping)}
    unknown = sorted(set(stated) - known)
    if unknown:
        raise ConfigurationError(
            f"unknown key {unknown[0]!r} in a column mapping; "
            f"known are {', '.join(sorted(known))}.",
            source=path,
        )
    stated.setdefault("name", path.stem)
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
    try:
        return ColumnMapping(**values)
    except TypeError as cause:
        raise ConfigurationError(f"column mapping: {cause}.", source=path) from cause
