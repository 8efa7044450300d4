"""How well each point of a part will be known, side by side: one panel for each machined group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Annotated, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import LogLocator, NullFormatter

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ShapeError
from robotrue.report.figure import BAD, INK, MUTED, inline_svg, png

COLOURS: Final = "viridis"
LEAST_SPAN: Final = 2.0
"""Largest over smallest value of the colour scale, at least: near-equal values look equal."""
MARKS: Final = 60.0
ROOM: Final = 0.06
"""Of the part's size, left free around its points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartMap(Columns):
    """Plot of machined points over the part, coloured by what they will be known to.

    Attributes:
        groups: Name of each panel.
        point: (m, 3) m in part.
        group: (m,) panel of each point.
        radius: (m,) m that holds a point's error with 95 %.
        touch: (n, 3) m in part, touched points.
        touch_group: (n,) panel each is drawn on; -1: on none.
        uncovered: Names of the groups that no touch covers.
        title: Heading.
        caption: One sentence.
    """

    groups: tuple[str, ...]
    point: Annotated[Array, Column("m 3", unit="m")]
    group: Annotated[Array, Column("m")]
    radius: Annotated[Array, Column("m", unit="m")]
    touch: Annotated[Array, Column("t 3", unit="m")]
    touch_group: Annotated[Array, Column("t")]
    uncovered: tuple[str, ...] = ()
    title: str = "How well each machined point will be known"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is a point, and the radii.

        Raises:
            ShapeError: No point, or a radius of 0 or less.
        """
        if not len(self.point) or not (self.radius > 0.0).all():
            raise ShapeError("part map: one point or more, with radii above 0, are needed.")


def part_map_svg(plot: PartMap, key: str) -> str:
    """Returns the map as SVG."""
    label = escape(plot.title, quote=True)
    return inline_svg(
        _drawing(plot), key=key, label=label, height=3.9, panels=max(len(plot.groups), 2)
    )


def part_map_png(plot: PartMap) -> bytes:
    """Returns the map as a PNG picture."""
    return png(
        _drawing(plot),
        width=1.2 + 4.0 * max(len(plot.groups), 2),
        height=4.3,
        panels=max(len(plot.groups), 2),
        title=plot.title,
    )


def _drawing(plot: PartMap) -> Callable[[list[Axes]], None]:
    low, high = plot.radius.min() / MM, plot.radius.max() / MM
    if high / low < LEAST_SPAN:
        middle = np.sqrt(low * high)
        low, high = middle / np.sqrt(LEAST_SPAN), middle * np.sqrt(LEAST_SPAN)
    norm = LogNorm(low, high)

    def draw(axes: list[Axes]) -> None:
        for ax in axes[len(plot.groups) :]:
            ax.set_axis_off()
        for k, (name, ax) in enumerate(zip(plot.groups, axes, strict=False)):
            mine = plot.group == k
            across, up = _plane(plot.point[mine])
            seen = ax.scatter(
                plot.point[mine, across] / MM, plot.point[mine, up] / MM,
                c=plot.radius[mine] / MM, norm=norm, cmap=mpl.colormaps[COLOURS], s=MARKS,
                linewidths=0.0,
            )  # fmt: skip
            here = plot.touch_group == k
            ax.plot(
                plot.touch[here, across] / MM, plot.touch[here, up] / MM, "o", color=INK,
                markerfacecolor="none", markersize=13.0, markeredgewidth=1.4,
                label="touched from this side",
            )  # fmt: skip
            worst = plot.radius[mine].max() / MM
            flag = ", no touch covers it" if name in plot.uncovered else ""
            ax.set_title(
                f"{name}: up to {worst:.2f} mm{flag}", color=BAD if flag else INK, fontsize=11.0
            )
            ax.set_xlabel(f"{'xyz'[across]}, mm (part)")
            ax.set_ylabel(f"{'xyz'[up]}, mm (part)")
            ax.set_aspect("equal", adjustable="box")
            ax.margins(ROOM)
        axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left")
        bar = axes[0].figure.colorbar(seen, ax=axes[: len(plot.groups)], shrink=0.9, pad=0.02)
        bar.set_label("95 % of the errors within, mm", color=INK)
        bar.ax.yaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
        bar.ax.tick_params(labelsize=9.0, color=MUTED)
        bar.outline.set_visible(False)

    return draw


def _plane(point: Array) -> tuple[int, int]:
    """The two axes of the part along which the points reach farthest, in order."""
    wide = np.sort(np.argsort(-np.ptp(point, axis=0), kind="stable")[:2])
    return int(wide[0]), int(wide[1])
