"""Errors before and after, drawn as SVG: along the poses or targets, by size, by moving axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias

from markupsafe import Markup

from robotrue.web.page_context import PageContext
from robotrue.web.parts.curve import LEFT, STEPS

FINE_STEPS: Final = (1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2, 2.2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 9)
"""Round lengths for a scale that spans less than those of ``STEPS``."""
FEWEST_TICKS: Final = 3
MOST_NUMBERS: Final = 6
"""Target numbers along the lower axis."""
TALL: Final = 700
"""Height of a chart next to the 3-D view."""
CHARTS: Final = ("pose", "sizes")
"""Charts of a page: errors along the poses or targets, and their distribution."""
BOTH: Final = ("before", "after")
Described: TypeAlias = Mapping[str, Any]
"""JSON values of a target, an axis or all sizes, lengths in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartArea:
    """Area of a chart, and the logarithmic scale of its lengths.

    Attributes:
        low_m: Length at the lower end.
        high_m: Length at the upper end.
        wide: Width in the units of the drawing.
        tall: Height.
    """

    low_m: float
    high_m: float
    wide: int = 620
    tall: int = 240
    left: int = LEFT
    right: int = 608
    top: int = 12

    @property
    def bottom(self) -> int:
        """Ordinate of the lower axis."""
        return self.tall - 26

    def share(self, length: float) -> float:
        """Returns where a length in m lies between the ends, 0 to 1."""
        inside = min(max(length, self.low_m), self.high_m)
        return math.log(inside / self.low_m) / math.log(self.high_m / self.low_m)

    def ticks(self) -> list[float]:
        """Returns the round lengths in m between the ends: coarse ones, or finer ones if few."""
        powers = range(math.floor(math.log10(self.low_m)), math.ceil(math.log10(self.high_m)) + 1)
        found: list[float] = []
        for steps in (STEPS, FINE_STEPS):
            every = [step * 10.0**power for power in powers for step in steps]
            found = [each for each in every if self.low_m <= each <= self.high_m]
            if len(found) >= FEWEST_TICKS:
                break
        return found


def draw_residuals(
    context: PageContext, poses: Sequence[Mapping[str, float]], sizes: Described
) -> Markup:
    """Returns both charts of measured poses; lengths on a logarithmic scale.

    Args:
        context: Of the page: its unit of errors and its words.
        poses: ``row``, ``line``, ``before_m``, ``after_m`` of those that are drawn.
        sizes: Of all, as ``errors_along.count_sizes`` returns them.
    """
    paper = ChartArea(low_m=sizes["low_m"], high_m=sizes["high_m"])
    rows = [
        {**each, "number": number, "point": each["row"] - 1}
        for number, each in enumerate(poses, start=1)
    ]
    return _draw(context, paper, rows, sizes["counts"], words="residuals")


def draw_along(context: PageContext, along: Described, *, compared: bool) -> dict[str, Markup]:
    """Returns the charts of a program: ``pose`` by target, ``sizes`` by size and by moving axis.

    Args:
        context: Of the page: its unit of errors and its words.
        along: As ``errors_along.describe_errors`` returns it.
        compared: Whether there is a program before this one; if not, its own errors are drawn.
    """
    paper = ChartArea(low_m=along["low_m"], high_m=along["high_m"])
    counts = {name: along["counts"][name] for name in (BOTH if compared else ("before",))}
    step = max(1, -(-along["last"] // MOST_NUMBERS))
    numbers = [1, *range(step, along["last"] - step // 2, step), along["last"]]
    files = {each["file"] for each in along["rows"]}
    return {
        part: _draw(
            context,
            paper,
            along["rows"],
            counts,
            words="along",
            charts=(part,),
            file_named=len(files) > 1,
            thinned=along["thinned"],
            last=along["last"],
            numbers=list(dict.fromkeys(numbers)),
            movers=along["movers"],
        )
        for part in CHARTS
    }


def _draw(
    context: PageContext,
    paper: ChartArea,
    rows: Sequence[Described],
    counts: Mapping[str, Sequence[int]],
    *,
    words: str,
    charts: Sequence[str] = CHARTS,
    file_named: bool = False,
    thinned: bool = False,
    last: int | None = None,
    numbers: Sequence[int] = (),
    movers: Sequence[Described] = (),
) -> Markup:
    """The charts; ``words`` names the texts about poses or targets."""
    return context.render(
        "residuals.html",
        paper=paper,
        tall=replace(paper, tall=TALL) if movers else paper,
        rows=rows,
        counts=counts,
        most=max(max(each) for each in counts.values()),
        words=words,
        charts=charts,
        file_named=file_named,
        thinned=thinned,
        last=len(rows) if last is None else last,
        numbers=numbers,
        movers=movers,
    )
