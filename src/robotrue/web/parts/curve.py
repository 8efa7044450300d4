"""A number against a count, drawn as SVG in the colours of the page; no library, no script."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from markupsafe import Markup

from robotrue.web.templating import render

WIDTH: Final = 760
HEIGHT: Final = 300
LEFT: Final = 58
RIGHT: Final = 14
TOP: Final = 30
BOTTOM: Final = 42
STEPS: Final = (1, 2, 5)
MOST_COUNTS: Final = 9
"""Numbers along the lower axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One curve; all sequences have one number per count.

    Attributes:
        label: Name of the curve.
        values: Above zero.
        low: Lower edge of its band; empty: no band.
        high: Upper edge.
        look: ``ours`` is emphasised, ``other`` is muted.
    """

    label: str
    values: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    look: Literal["ours", "other"] = "ours"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Paper:
    """Coordinates of a chart: counts evenly, values by their logarithm."""

    first: float
    last: float
    low: float
    high: float

    left: int = LEFT
    right: int = WIDTH - RIGHT
    width: int = WIDTH
    height: int = HEIGHT
    bottom: int = HEIGHT - BOTTOM

    def x(self, count: float) -> float:
        """Returns where a count lies."""
        share = (count - self.first) / max(self.last - self.first, 1e-9)
        return LEFT + share * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        """Returns where a value lies."""
        inside = min(max(value, self.low), self.high)
        share = math.log(inside / self.low) / math.log(self.high / self.low)
        return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)

    def ticks(self) -> list[float]:
        """Returns the round values within the paper."""
        low, high = self.low, self.high
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        return [s * 10.0**p for p in powers for s in STEPS if low <= s * 10.0**p <= high]

    def points(self, counts: Sequence[float], values: Sequence[float]) -> list[str]:
        """Returns where values lie, as SVG states points."""
        pairs = zip(counts, values, strict=True)
        return [f"{self.x(count):.1f},{self.y(value):.1f}" for count, value in pairs]


def curve(
    counts: Sequence[float],
    lines: Sequence[Line],
    *,
    title: str,
    across: str,
    up: str,
    floor: tuple[float, str] | None = None,
) -> Markup:
    """Returns curves over a common axis of counts, values on a logarithmic scale.

    Args:
        counts: Ascending.
        lines: At least one, above zero.
        title: What is shown, for screen readers.
        across: What is counted.
        up: What the values are, with their unit.
        floor: A value no curve can fall below, and its name.
    """
    every = [v for line in lines for v in (*line.values, *line.low, *line.high) if v > 0.0]
    every += [floor[0]] if floor is not None and floor[0] > 0.0 else []
    paper = _Paper(first=counts[0], last=counts[-1], low=0.85 * min(every), high=1.15 * max(every))
    step = max(1, -(-len(counts) // MOST_COUNTS))
    return render(
        "curve.html",
        paper=paper,
        counts=counts,
        lines=lines,
        marked=[*counts[: -step // 2 or None : step], counts[-1]],
        title=title,
        across=across,
        up=up,
        floor=floor,
    )
