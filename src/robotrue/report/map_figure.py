"""Slices of a workspace map as small multiples: one row a quantity, one column a slice."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Colormap
from matplotlib.ticker import MaxNLocator

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.report.content import MapSlices
from robotrue.report.figure import INK, MUTED, inline_svg, png

SEQUENTIAL: Final = "viridis"
DIVERGING: Final = "coolwarm"
"""Both are readable on a light and on a dark card; the diverging one is grey at zero."""
STEPS: Final = 10


def slices_svg(plot: MapSlices, key: str) -> str:
    """Returns the slices as SVG."""
    rows, columns = len(plot.quantities), len(plot.slices)
    return inline_svg(
        _drawing(plot),
        key=key,
        label=escape(plot.title, quote=True),
        height=0.6 + 1.75 * rows,
        panels=columns,
        rows=rows,
    )


def slices_png(plot: MapSlices) -> bytes:
    """Returns the slices as a PNG picture."""
    rows, columns = len(plot.quantities), len(plot.slices)
    return png(
        _drawing(plot),
        width=max(10.0, 2.4 * columns),
        height=1.0 + 1.9 * rows,
        panels=columns,
        rows=rows,
        title=plot.title,
    )


def _drawing(plot: MapSlices) -> Callable[[list[Axes]], None]:
    columns = len(plot.slices)

    def draw(axes: list[Axes]) -> None:
        for r, quantity in enumerate(plot.quantities):
            line = axes[r * columns : (r + 1) * columns]
            cmap, norm = _scale(plot.values[r] / MM, plot.signed[r])
            for c, ax in enumerate(line):
                mesh = ax.pcolormesh(
                    _edges(plot.across), _edges(plot.up),
                    np.ma.masked_invalid(plot.values[r, c] / MM), cmap=cmap, norm=norm,
                    edgecolors="face", linewidth=0.2,
                )  # fmt: skip
                _empty(ax, plot, plot.values[r, c])
                _frame(ax, plot, c == 0, r == len(plot.quantities) - 1)
                if r == 0:
                    ax.set_title(plot.slices[c], fontsize=11.0)
            bar = line[0].figure.colorbar(mesh, ax=line, shrink=0.9, aspect=14, pad=0.01)
            bar.set_label(f"{quantity}, mm", color=INK)
            bar.outline.set_visible(False)
            bar.ax.tick_params(labelsize=9.0)

    return draw


def _scale(values: Array, signed: bool) -> tuple[Colormap, BoundaryNorm]:
    known = values[np.isfinite(values)]
    low, high = float(known.min()), float(known.max())
    if signed:
        high = max(abs(low), abs(high))
        low = -high
    if high - low < 1e-6:
        low, high = low - 1e-3, high + 1e-3
    levels = MaxNLocator(nbins=STEPS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    cmap = mpl.colormaps[DIVERGING if signed else SEQUENTIAL].resampled(len(levels) - 1)
    return cmap, BoundaryNorm(levels, cmap.N)


def _edges(centre: Array) -> Array:
    """Edges of the cells about grid values; one value alone gets a cell of its own size."""
    if len(centre) == 1:
        half = 0.5 * max(abs(float(centre[0])), 1.0) * 0.1
        return np.array([centre[0] - half, centre[0] + half])
    middle = 0.5 * (centre[1:] + centre[:-1])
    return np.concatenate([[2 * centre[0] - middle[0]], middle, [2 * centre[-1] - middle[-1]]])


def _empty(ax: Axes, plot: MapSlices, values: Array) -> None:
    """A small cross where the arm cannot go."""
    row, column = np.nonzero(~np.isfinite(values))
    if len(row):
        ax.plot(
            plot.across[column], plot.up[row], "x", color=MUTED, markersize=3.5, markeredgewidth=0.8
        )


def _frame(ax: Axes, plot: MapSlices, first: bool, last: bool) -> None:
    ax.grid(visible=False)
    ax.tick_params(labelsize=9.0, labelleft=first, labelbottom=last)
    ax.xaxis.set_major_locator(MaxNLocator(nbins=4))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=4))
    if first:
        ax.set_ylabel(plot.up_label, fontsize=10.0)
    if last:
        ax.set_xlabel(plot.across_label, fontsize=10.0)
