"""How well the tool point will be known, over the places the arm was calibrated for."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Annotated, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ShapeError
from robotrue.report.figure import INK, MUTED, inline_svg
from robotrue.report.words import ENGLISH, Words

COLOURS: Final = "viridis"
LEAST_SPAN: Final = 1.2
"""Largest over smallest value of the colour scale, at least: near-equal values look equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyMap(Columns):
    """Plot of places seen from above and from the side, coloured by the radius of 95 %.

    Attributes:
        position: (n, 3) m in base.
        radius: (n,) m that holds a point's error with 95 %.
        title: Heading.
        caption: One sentence.
    """

    position: Annotated[Array, Column("n 3", unit="m")]
    radius: Annotated[Array, Column("n", unit="m")]
    title: str
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is a point."""
        if not len(self.radius):
            raise ShapeError("uncertainty map: no points.")


def uncertainty_svg(plot: UncertaintyMap, key: str, words: Words = ENGLISH) -> str:
    """Returns the places from above (x, y) and from the side (x, z), as SVG."""
    low, high = float(plot.radius.min()) / MM, float(plot.radius.max()) / MM
    if high < LEAST_SPAN * low:
        middle = 0.5 * (low + high)
        low, high = middle / np.sqrt(LEAST_SPAN), middle * np.sqrt(LEAST_SPAN)
    norm = Normalize(low, high)
    order = np.argsort(plot.radius, kind="stable")  # the least known on top

    def draw(axes: list[Axes]) -> None:
        for ax, (across, up) in zip(axes, ((0, 1), (0, 2)), strict=True):
            seen = ax.scatter(
                plot.position[order, across], plot.position[order, up],
                c=plot.radius[order] / MM, norm=norm, cmap=mpl.colormaps[COLOURS], s=15.0,
                linewidths=0.0,
            )  # fmt: skip
            ax.plot(0.0, 0.0, "+", color=MUTED, markersize=11)
            ax.set_xlabel(words("plot.axis", axis="xyz"[across], frame="base"))
            ax.set_ylabel(words("plot.axis", axis="xyz"[up], frame="base"))
            ax.set_aspect("equal", adjustable="datalim")
        bar = axes[0].figure.colorbar(seen, ax=axes, shrink=0.9, aspect=18, pad=0.02)
        bar.set_label(words("plot.radius"), color=INK)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=9.0)

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=4.6, panels=2)
