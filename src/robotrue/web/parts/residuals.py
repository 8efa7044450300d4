"""Errors of poses before and after, drawn as SVG: pose by pose, and how many are how large."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from markupsafe import Markup

from robotrue.web.page_context import PageContext

BINS: Final = 24
WIDTH: Final = 760
HEIGHT: Final = 240
LEFT: Final = 58
RIGHT: Final = 12
TOP: Final = 12
BOTTOM: Final = 26
STEPS: Final = (1, 2, 5)


def draw_residuals(context: PageContext, poses: Sequence[Mapping[str, float]]) -> Markup:
    """Returns both charts; lengths on a logarithmic scale, a number at each point of the first.

    Args:
        context: Of the page: its unit of errors and its words.
        poses: ``row``, ``line``, ``before_m``, ``after_m`` of each.
    """
    floor = 1e-7
    lengths = [max(each[name], floor) for each in poses for name in ("before_m", "after_m")]
    low, high = min(lengths) / 1.1, max(lengths) * 1.1

    def share(length: float) -> float:
        return math.log(max(length, floor) / low) / math.log(high / low)

    def count(name: str) -> list[int]:
        found = [0] * BINS
        for each in poses:
            found[min(BINS - 1, int(share(each[name]) * BINS))] += 1
        return found

    counts = {"before": count("before_m"), "after": count("after_m")}
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [s * 10.0**p for p in powers for s in STEPS if low <= s * 10.0**p <= high]
    return context.render(
        "residuals.html",
        poses=poses,
        counts=counts,
        most=max(max(each) for each in counts.values()),
        ticks=ticks,
        share=share,
        paper={"width": WIDTH, "height": HEIGHT, "left": LEFT, "right": WIDTH - RIGHT,
               "top": TOP, "bottom": HEIGHT - BOTTOM},
    )  # fmt: skip
