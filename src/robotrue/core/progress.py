"""Progress of long work, reported to a callback."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with what is done next, how much is done, and of how much; may raise to end the work."""


def unheard(text: str, done: int, of: int) -> None:
    """Discards the report."""
