"""The result of an operation that reports numbers and leaves nothing to compute later."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

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

    values: Mapping[str, Any] = field(default_factory=dict)
    shown: tuple[Block, ...] = ()
    provenance: Provenance | None = None

    def document(self) -> Mapping[str, Any]:
        """Returns JSON values."""
        return self.values

    def blocks(self) -> Iterable[Block]:
        """Returns what is shown instead of the document."""
        return self.shown
