"""Lines of a drilling journal, read without touching the file: also while a session writes it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robotrue.errors import FormatError


def foreign_line(source: str | Path, number: int) -> FormatError:
    """Returns the error of a line that is none of a journal."""
    return FormatError(
        "not a line of a drilling journal.",
        source=source,
        line=number,
        hint="another file for the journal; this one is left as it is.",
    )


def whole_lines(
    data: bytes, *, source: str | Path, first: int = 1
) -> tuple[list[dict[str, Any]], int]:
    """Returns the entries of all lines that have their end, and how many bytes those are.

    Args:
        data: Of the file, from the beginning of a line on.
        source: The file.
        first: Number of the first line.

    Raises:
        FormatError: A line that is none of a journal; with its number.
    """
    whole = data.rfind(b"\n") + 1
    out = []
    for number, line in enumerate(data[:whole].splitlines(), start=first):
        try:
            entry = json.loads(line)
            if entry["kind"] not in ("answer", "reference"):
                raise KeyError(entry["kind"])
            str(entry["hole"]), str(entry["status"]), int(entry["version"])
        except (ValueError, KeyError, TypeError, RecursionError) as cause:
            raise foreign_line(source, number) from cause
        out.append(entry)
    return out, whole
