"""Lines of a drilling journal, read without touching the file: also while a session writes it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError, FormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalEntry:
    """A line of a journal.

    Attributes:
        kind: An answer to the machine, or a reference it measured afterwards.
        hole: Its name.
        status: ``move``, ``refused``, ``recorded`` or ``alarm``.
        version: Of the model.
        document: All that the line states.
    """

    kind: Literal["answer", "reference"]
    hole: str
    status: str
    version: int
    document: Mapping[str, object] = field(default_factory=dict)


def foreign_line(source: str | Path, number: int) -> FormatError:
    """Returns the error of a line that is not of a journal."""
    return FormatError(
        "not a line of a drilling journal.",
        source=source,
        line=number,
        hint="another file for the journal; this one is not overwritten.",
    )


def whole_lines(data: bytes, *, source: str | Path) -> tuple[list[JournalEntry], int]:
    """Returns the entries of all complete lines, and their number of bytes.

    Args:
        data: Of the file, from the beginning of a line on.
        source: The file.

    Raises:
        FormatError: A line that is not of a journal; with its number.
    """
    whole = data.rfind(b"\n") + 1
    entries = []
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            stated = json.loads(line)
            entries.append(replace(decode(JournalEntry, stated), document=stated))
        except (ValueError, ArchiveError, RecursionError) as cause:
            raise foreign_line(source, number) from cause
    return entries, whole
