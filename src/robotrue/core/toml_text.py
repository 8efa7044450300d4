"""TOML as tables, with the line of whatever is wrong with it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from robotrue.core.files import read_bytes
from robotrue.core.utf8 import utf8_text
from robotrue.errors import ConfigurationError


def read_toml(path: str | Path, *, example: str) -> tuple[dict[str, Any], str]:
    """Returns the tables of a TOML file and its text, for the lines of later faults.

    Args:
        path: The file.
        example: Where the user finds one that is right.

    Raises:
        ConfigurationError: Not UTF-8 or not TOML, with the line.
        FormatError: The file cannot be read.
    """
    return parse_toml(read_bytes(path), path, example=example)


def parse_toml(data: bytes, path: str | Path, *, example: str) -> tuple[dict[str, Any], str]:
    """Returns the tables in the content of a file and its text; see :func:`read_toml`.

    Raises:
        ConfigurationError: Not UTF-8 or not TOML, with the line.
    """
    text = utf8_text(data, path, error=ConfigurationError)
    try:
        return tomllib.loads(text), text
    except (tomllib.TOMLDecodeError, RecursionError) as cause:
        head, _, place = (str(cause) or "nested too deeply").partition(" (at ")
        digits = "".join(c for c in place.partition("line ")[2].partition(",")[0] if c.isdigit())
        raise ConfigurationError(
            f"not TOML: {head}.",
            source=path,
            line=int(digits) if digits else text.count("\n") + 1,
            hint=f"compare the line with the example in {example}.",
        ) from None
