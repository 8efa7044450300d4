"""Results of numbers that nobody computes with: JSON values, and blocks that show them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from robotrue.app.presentation import Block
from robotrue.core.provenance import Provenance


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


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFiles:
    """Files that were written.

    Attributes:
        written: Where they are.
        numbers: About them, JSON values.
        provenance: Of what they rest on.
    """

    written: tuple[Path, ...]
    numbers: Mapping[str, object]
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return {"written": [str(path) for path in self.written], **self.numbers}

    def blocks(self) -> Iterable[Block]:
        """Returns nothing: what is to be said is said when they are written."""
        return ()
