"""Holes of a drilling session as they come, or those of a test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from nicegui.element import Element

from robotrue.web.bench import Bench

TEXTS: Final = (
    "waiting", "holes", "refused", "p95", "mean", "within", "alarms", "model", "frozen", "learning",
    "before", "before_note", "after", "after_note", "run", "run_note", "latest", "hole", "when",
    "seen", "left", "version", "state_refused", "state_alarm", "state_moved", "state_beyond",
    "state_within", "shifted", "thawed",
)  # fmt: skip


class DrillMonitor(Element, component="drilling.js"):
    """Bull's-eyes of the tilt before and after, the run of what is left, alarms, the last holes."""

    def __init__(
        self,
        bench: Bench,
        *,
        tolerance_deg: float,
        source: str = "",
        holes: Sequence[Mapping[str, Sequence[float]]] | None = None,
        texts: Mapping[str, str] | None = None,
    ) -> None:
        """Makes it.

        Args:
            bench: Who looks.
            tolerance_deg: What the tilt left is to be within.
            source: Address of a journal that is followed; empty: ``holes`` are all.
            holes: ``before`` and ``left`` of each, a and b in deg.
            texts: In place of those of a session.
        """
        super().__init__()
        words = {name: bench.say(f"drilling.{name}") for name in TEXTS} | dict(texts or {})
        for name, value in (
            ("src", source), ("fixed", holes), ("tolerance", tolerance_deg),
            ("language", bench.say.language), ("text", words),
        ):  # fmt: skip
            self._props[name] = value
