"""A number against a count, drawn as SVG in the colours of the page; no library, no script."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final, Literal

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
        label: What it is.
        values: Above zero.
        low: Lower edge of its band; empty: no band.
        high: Upper edge.
        look: ``ours`` stands out, ``other`` stands back.
    """

    label: str
    values: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    look: Literal["ours", "other"] = "ours"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Paper:
    """Where counts and values lie: counts evenly, values by their logarithm."""

    first: float
    last: float
    low: float
    high: float

    def x(self, count: float) -> float:
        share = (count - self.first) / max(self.last - self.first, 1e-9)
        return LEFT + share * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        inside = min(max(value, self.low), self.high)
        share = math.log(inside / self.low) / math.log(self.high / self.low)
        return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)


def curve(
    counts: Sequence[float],
    lines: Sequence[Line],
    *,
    title: str,
    across: str,
    up: str,
    floor: tuple[float, str] | None = None,
) -> str:
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
    body = _grid(paper, counts, across, up)
    body += "".join(_band(paper, counts, line) for line in lines if line.low)
    if floor is not None:
        y = paper.y(floor[0])
        body += (
            f'<line class="floor" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{WIDTH - RIGHT}" y="{y - 5:.1f}" text-anchor="end">{escape(floor[1])}</text>'
        )
    body += "".join(_drawn(paper, counts, line) for line in reversed(lines))
    return (
        f'<svg class="chart curve" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(title)}">{body}</svg>{_legend(lines)}'
    )


def _grid(paper: _Paper, counts: Sequence[float], across: str, up: str) -> str:
    out = f'<text x="{LEFT}" y="14">{escape(up)}</text>'
    for value in _ticks(paper.low, paper.high):
        y = paper.y(value)
        out += (
            f'<line class="rule" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
        )
    step = max(1, -(-len(counts) // MOST_COUNTS))
    for count in [*counts[: -step // 2 or None : step], counts[-1]]:
        out += (
            f'<text x="{paper.x(count):.1f}" y="{HEIGHT - BOTTOM + 18}" '
            f'text-anchor="middle">{count:g}</text>'
        )
    return out + (
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">'
        f"{escape(across)}</text>"
    )


def _ticks(low: float, high: float) -> list[float]:
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [s * 10.0**p for p in powers for s in STEPS if low <= s * 10.0**p <= high]


def _band(paper: _Paper, counts: Sequence[float], line: Line) -> str:
    there = [f"{paper.x(c):.1f},{paper.y(v):.1f}" for c, v in zip(counts, line.high, strict=True)]
    back = [f"{paper.x(c):.1f},{paper.y(v):.1f}" for c, v in zip(counts, line.low, strict=True)]
    return f'<polygon class="{line.look}" points="{" ".join([*there, *reversed(back)])}"/>'


def _drawn(paper: _Paper, counts: Sequence[float], line: Line) -> str:
    at = [(paper.x(c), paper.y(v), c, v) for c, v in zip(counts, line.values, strict=True)]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y, _, _ in at)
    dots = "".join(
        f'<circle class="{line.look}" cx="{x:.1f}" cy="{y:.1f}" r="3">'
        f"<title>{escape(line.label)}: {c:g}, {v:.3g}</title></circle>"
        for x, y, c, v in at
        if line.look == "ours"
    )
    return f'<polyline class="{line.look}" points="{points}"/>{dots}'


def _legend(lines: Sequence[Line]) -> str:
    entries = "".join(
        f'<span><i class="{line.look}"></i>{escape(line.label)}</span>' for line in lines
    )
    return f'<div class="curve-legend note">{entries}</div>'
