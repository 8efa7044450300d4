"""A place to drop files on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

from robotrue.web.bench import Bench


class DropZone(Element, component="drop.js"):
    """Sends files to ``/api/files`` and their ids on to an address, then opens what came of it."""

    def __init__(
        self,
        bench: Bench,
        *,
        title: str,
        hint: str,
        accept: str,
        then: str,
        go: str,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        """Makes the place.

        Args:
            bench: Who looks at it.
            title: What to drop.
            hint: Which files that are, or what becomes of them.
            accept: Endings the browser's file dialog offers; dropping is not limited to them.
            then: Address that gets ``{"uploads": [ids], **facts}``; empty: nothing is made yet.
            go: Page opened then; ``{id}`` is that of what was made, or those of the uploads.
            facts: Sent along.
        """
        super().__init__()
        for name, value in (
            ("title", title), ("hint", hint), ("accept", accept), ("then", then), ("go", go),
            ("facts", dict(facts or {})),
        ):  # fmt: skip
            self._props[name] = value
