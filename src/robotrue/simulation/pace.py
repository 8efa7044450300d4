"""The clock of a simulated controller: even on average, and never short of time for an answer."""

from __future__ import annotations

import asyncio
from typing import Final

_WHOLE: Final = 0.9
"""Of a cycle; a shorter one gives less time for an answer than a controller would."""
_SHORTEST: Final = 0.5
"""Of a cycle; what a computer that slept makes up for, cycle by cycle."""
_BEHIND: Final = 5
"""Cycles that are made up for so; what lies farther behind is left out where time is kept."""


class Pace:
    """Cycles of an event loop.

    Args:
        cycle: s.
    """

    def __init__(self, cycle: float) -> None:
        self._cycle = cycle
        self._due = asyncio.get_running_loop().time()

    async def wait(self) -> bool:
        """Waits for the end of the cycle that runs; call it right after its packet was sent.

        Returns whether it was shorter than a controller's, to make up for one that was overslept.

        Cycles that lie behind are made up for with shorter ones. A controller never sends two
        packets at once, and a computer that plays one must not, either: the answer to the first
        would be late through no fault of its sender.
        """
        now = asyncio.get_running_loop().time()
        self._due += self._cycle
        room = self._due - now
        await asyncio.sleep(max(room, _SHORTEST * self._cycle))
        return asyncio.get_running_loop().time() - now < _WHOLE * self._cycle

    def skip_overdue(self) -> int:
        """Skips cycles that lie too far behind and returns how many.

        A controller's clock does not go slower because a computer is busy; one that plays it sends
        fewer packets instead, as if they had been lost on their way.
        """
        behind = int((asyncio.get_running_loop().time() - self._due) / self._cycle)
        if behind <= _BEHIND:
            return 0
        self._due += behind * self._cycle
        return behind
