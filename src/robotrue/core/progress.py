"""Progress of long work, reported to a callback."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the next step, the finished amount, and the total; may raise to end the work."""


def unheard(text: str, done: int, of: int) -> None:
    """Discards the report."""
