"""Standard uncertainties side by side: which one a better cell would begin with."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Annotated, Final

import numpy as np
from matplotlib.axes import Axes

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import UM
from robotrue.errors import ShapeError
from robotrue.report.figure import AFTER, INK, MUTED, inline_svg
from robotrue.report.words import ENGLISH, Words

ROW: Final = 0.42
"""Inches of height a bar takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetPlot(Columns):
    """Plot of the contributions to a combined uncertainty.

    Attributes:
        names: Of the contributions, as they are to stand there.
        value: (n,) m, standard uncertainty of each.
        combined: m.
        combined_name: What it is called.
        title: Heading.
        caption: One sentence.
    """

    names: Annotated[tuple[str, ...], Column("n")]
    value: Annotated[Array, Column("n", unit="m")]
    combined: float
    combined_name: str
    title: str
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is a contribution."""
        if not self.names:
            raise ShapeError("budget plot: no contribution.")


def budget_svg(plot: BudgetPlot, key: str, words: Words = ENGLISH) -> str:
    """Returns one bar for each contribution and one for the sum, as SVG."""
    names = (*plot.names, plot.combined_name)
    value = np.append(plot.value, plot.combined) / UM

    def draw(axes: list[Axes]) -> None:
        (ax,) = axes
        place = np.arange(len(names))[::-1]
        colours = [*[AFTER] * len(plot.names), INK]
        ax.barh(place, value, height=0.62, color=colours)
        reach = float(value.max())
        for y, name, v in zip(place, names, value, strict=True):
            ax.text(-0.015 * reach, y, name, ha="right", va="center", color=INK)
            ax.text(v + 0.01 * reach, y, f"{v:.1f}", ha="left", va="center", color=MUTED)
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
        ax.grid(visible=False, axis="y")
        ax.set_xlim(0.0, 1.1 * reach)
        ax.set_xlabel(words("plot.uncertainty"))

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=0.9 + ROW * len(names))
