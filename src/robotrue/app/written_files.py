"""The result of operations that write files and say a few numbers about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robotrue.app.presentation import Block
from robotrue.core.provenance import Provenance


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFiles:
    """Files that were written.

    Attributes:
        written: Where they are.
        numbers: About them, JSON values.
        provenance: Of what they rest on.
    """

    written: tuple[Path, ...]
    numbers: Mapping[str, Any]
    provenance: Provenance

    def document(self) -> Mapping[str, Any]:
        """Returns JSON values."""
        return {"written": [str(path) for path in self.written], **self.numbers}

    def blocks(self) -> Iterable[Block]:
        """Returns nothing: what is to be said is said when they are written."""
        return ()
