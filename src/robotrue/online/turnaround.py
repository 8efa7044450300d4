"""How long answers took: a histogram of fixed size, good for years of cycles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

_LEAST: Final = 1e-6
_PER_DECADE: Final = 50
_DECADES: Final = 7


class Turnaround:
    """Times from a packet to its answer, counted in bins 4.7 % wide from 1 us to 10 s."""

    def __init__(self) -> None:
        self._bins = [0] * (_PER_DECADE * _DECADES)
        self.count = 0
        self.largest: float = math.nan

    @classmethod
    def of(cls, counts: Mapping[str, int], largest: float) -> Turnaround:
        """Returns the histogram that :meth:`counts` told of."""
        made = cls()
        for place, count in counts.items():
            made._bins[int(place)] = count
            made.count += count
        made.largest = largest
        return made

    def counts(self) -> dict[str, int]:
        """Returns the bins that hold something, by their number as text (for JSON)."""
        return {str(place): count for place, count in enumerate(self._bins) if count}

    def add(self, seconds: float) -> None:
        """Counts one answer."""
        place = int(math.log10(max(seconds, _LEAST) / _LEAST) * _PER_DECADE)
        self._bins[min(place, len(self._bins) - 1)] += 1
        self.count += 1
        if not seconds <= self.largest:
            self.largest = seconds

    def quantile(self, share: float) -> float:
        """Returns the upper edge in s of the bin that holds a share of the answers; NaN of none."""
        wanted, seen = share * self.count, 0
        for place, count in enumerate(self._bins):
            seen += count
            if count and seen >= wanted:
                return min(_LEAST * math.pow(10.0, (place + 1) / _PER_DECADE), self.largest)
        return math.nan
