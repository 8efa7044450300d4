"""The live view of a source with its limits and alarms; what it draws comes past the server."""

from __future__ import annotations

from typing import Final

from nicegui.element import Element

from robotrue.online.live_page import view_markup
from robotrue.web.bench import Bench
from robotrue.web.live_sources import LiveSource

TEXTS: Final = (
    "limits", "limits_rule", "limit_of", "save", "saved", "alarms", "no_alarms", "when", "axis",
    "value", "band", "limit", "duration", "now", "download", "unsure", "unfinished",
)  # fmt: skip
FILES: Final = "/live/files"
"""Where the view's scripts and style are served."""


class LiveView(Element, component="live.js"):
    """A live source."""

    def __init__(self, bench: Bench, source: LiveSource) -> None:
        """Makes the view.

        Args:
            bench: Who looks.
            source: At what.
        """
        super().__init__()
        words = {name: bench.say(f"live.{name}") for name in TEXTS}
        for name, value in (
            ("id", source.id), ("files", FILES), ("markup", view_markup()),
            ("language", bench.say.language), ("text", words), ("held", list(source.limits)),
        ):  # fmt: skip
            self._props[name] = value
