"""Results of an operation, and what they show: facts, tables and notes as values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import TypeAlias

from robotrue.core.provenance import Provenance


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Names and values under a title.

    Attributes:
        title: Above them.
        rows: Name and value.
        measured: Whether they do not depend on the simulated data of the result: not marked.
    """

    title: str
    rows: tuple[tuple[str, str], ...]
    measured: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table under a title.

    Attributes:
        title: Above it.
        columns: Headings; all empty leaves them out.
        rows: One text per column.
        words: The columns after the first hold words and not numbers.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: bool = False


@dataclass(frozen=True, slots=True)
class Note:
    """One line next to the numbers."""

    text: str


@dataclass(frozen=True, slots=True)
class Text:
    """Lines to paste elsewhere, unchanged."""

    text: str


Block: TypeAlias = Facts | Table | Note | Text


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveView:
    """Snapshot of a running service.

    Attributes:
        line: The moment in one line.
        table: Its counters.
        at: s since the service started.
    """

    line: str
    table: Table
    at: float


def count(number: int, noun: str) -> str:
    """Returns e.g. ``"1 file"`` or ``"2 files"``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def time_text(time: datetime | None) -> str:
    """Returns a time in the zone of this computer; empty for none."""
    return "" if time is None else f"{time.astimezone():%Y-%m-%d %H:%M:%S}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainResult:
    """JSON values and the blocks that show them.

    Attributes:
        values: Of ``--json``, units in the names.
        shown: What a terminal or a page shows instead.
        provenance: Of the data it rests on; None if it rests on none.
    """

    values: Mapping[str, object] = field(default_factory=dict)
    shown: tuple[Block, ...] = ()
    provenance: Provenance | None = None

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return self.values

    def blocks(self) -> Iterable[Block]:
        """Returns what is shown instead of the document."""
        return self.shown
