"""Plots of places: what is known of a part, of the workspace, slices of a map, a side of a part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import BoundaryNorm, Colormap, LogNorm, Normalize
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from robotrue.core.arrays import Array
from robotrue.core.columns import Column
from robotrue.core.units import MM
from robotrue.errors import ShapeError
from robotrue.report.content import Plot, nullable
from robotrue.report.figure import AFTER, BAD, INK, MUTED, Drawing
from robotrue.report.words import ReportTexts

SEQUENTIAL: Final = "viridis"
DIVERGING: Final = "coolwarm"
"""Both are readable on a light and on a dark card; the diverging one is grey at zero."""
LEAST_SPAN: Final = 1.2
LEAST_LOG_SPAN: Final = 2.0
"""Largest over smallest value of a colour scale, at least."""
STEPS: Final = 10
"""Colours of a slice's scale, about."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartMap(Plot):
    """Plot of machined points over the part, coloured by what they will be known to.

    Attributes:
        groups: Name of each panel.
        point: (m, 3) m in part.
        group: (m,) panel of each point.
        radius: (m,) m that holds a point's error with 95 %.
        touch: (n, 3) m in part, touched points.
        touch_group: (n,) panel each is drawn on; -1: on none.
        uncovered: Names of the groups that no touch covers.
    """

    groups: tuple[str, ...]
    point: Annotated[Array, Column("m 3", unit="m")]
    group: Annotated[Array, Column("m")]
    radius: Annotated[Array, Column("m", unit="m")]
    touch: Annotated[Array, Column("t 3", unit="m")]
    touch_group: Annotated[Array, Column("t")]
    uncovered: tuple[str, ...] = ()
    title: str = "Expected uncertainty of each machined point"
    kind: ClassVar[str] = "part_map"
    json_keys: ClassVar[Mapping[str, str]] = {"groups": "groups"}

    def _check_rules(self) -> None:
        """Checks that there is a point, and the radii."""
        if not len(self.point) or not (self.radius > 0.0).all():
            raise ShapeError("part map: one point or more, with radii above 0, are needed.")

    def _json_more(self) -> dict[str, object]:  # not rounded
        return {
            "group": [int(k) for k in self.group],
            "point_mm": (self.point / MM).tolist(),
            "radius_95_mm": (self.radius / MM).tolist(),
            "touch_mm": (self.touch / MM).tolist(),
            "uncovered": list(self.uncovered),
        }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns one panel for each machined group, side by side."""
        norm = LogNorm(*_widen_log(self.radius.min() / MM, self.radius.max() / MM))

        def draw(axes: list[Axes]) -> None:
            for ax in axes[len(self.groups) :]:
                ax.set_axis_off()
            for k, ax in enumerate(axes[: len(self.groups)]):
                points = self._draw_group(ax, k, norm)
            axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left")
            bar = axes[0].figure.colorbar(points, ax=axes[: len(self.groups)], shrink=0.9, pad=0.02)
            bar.ax.yaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
            bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            bar.ax.yaxis.set_minor_formatter(NullFormatter())
            _style_bar(bar, "radius of 95 % of the errors, mm")
            bar.ax.tick_params(color=MUTED)

        panels = max(len(self.groups), 2)
        return Drawing(draw=draw, width=1.2 + 4.0 * panels, height=3.9, panels=panels)

    def _draw_group(self, ax: Axes, k: int, norm: LogNorm) -> PathCollection:
        """Draws one panel; returns the coloured points, for the scale."""
        shown, touched = self.group == k, self.touch_group == k
        # the two axes of the part along which the points reach farthest, in order
        reach = np.argsort(-np.ptp(self.point[shown], axis=0), kind="stable")
        across, up = np.sort(reach[:2]).tolist()
        points = ax.scatter(
            self.point[shown, across] / MM, self.point[shown, up] / MM,
            c=self.radius[shown] / MM, norm=norm, cmap=mpl.colormaps[SEQUENTIAL], s=60.0,
            linewidths=0.0,
        )  # fmt: skip
        ax.plot(
            self.touch[touched, across] / MM, self.touch[touched, up] / MM, "o", color=INK,
            markerfacecolor="none", markersize=13.0, markeredgewidth=1.4,
            label="probed from this side",
        )  # fmt: skip
        name, worst = self.groups[k], self.radius[shown].max() / MM
        flag = ", no touch covers it" if name in self.uncovered else ""
        title = f"{name}: up to {worst:.2f} mm{flag}"
        ax.set_title(title, color=BAD if flag else INK, fontsize=11.0)
        ax.set_xlabel(f"{'xyz'[across]}, mm (part)")
        ax.set_ylabel(f"{'xyz'[up]}, mm (part)")
        ax.set_aspect("equal", adjustable="box")
        ax.margins(0.06)
        return points


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyMap(Plot):
    """Plot of places seen from above and from the side, coloured by the radius of 95 %.

    Attributes:
        position: (n, 3) m in base.
        radius: (n,) m that holds a point's error with 95 %.
    """

    position: Annotated[Array, Column("n 3", unit="m")]
    radius: Annotated[Array, Column("n", unit="m")]
    kind: ClassVar[str] = "uncertainty-map"
    json_keys: ClassVar[Mapping[str, str]] = {"position_mm": "position", "radius_95_mm": "radius"}

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the places from above (x, y) and from the side (x, z)."""
        norm = Normalize(*_widen(float(self.radius.min()) / MM, float(self.radius.max()) / MM))
        order = np.argsort(self.radius, kind="stable")  # the least known on top

        def draw(axes: list[Axes]) -> None:
            for ax, (across, up) in zip(axes, ((0, 1), (0, 2)), strict=True):
                points = ax.scatter(
                    self.position[order, across], self.position[order, up],
                    c=self.radius[order] / MM, norm=norm, cmap=mpl.colormaps[SEQUENTIAL], s=15.0,
                    linewidths=0.0,
                )  # fmt: skip
                ax.plot(0.0, 0.0, "+", color=MUTED, markersize=11)
                ax.set_xlabel(words("plot.axis", axis="xyz"[across], frame="base"))
                ax.set_ylabel(words("plot.axis", axis="xyz"[up], frame="base"))
                ax.set_aspect("equal", adjustable="datalim")
            bar = axes[0].figure.colorbar(points, ax=axes, shrink=0.9, aspect=18, pad=0.02)
            _style_bar(bar, words("plot.radius"))

        return Drawing(draw=draw, height=4.6, panels=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSlices(Plot):
    """Plot of quantities over slices of a region: one row a quantity, one column a slice.

    Attributes:
        quantities: Name of each row.
        slices: Name of each column.
        values: (rows, columns, k, l) m; NaN is drawn as a gap.
        signed: Per row, whether its values have a sign (error along an axis).
        across: (l,) grid values along the horizontal axis, in the unit of its label.
        up: (k,) grid values along the vertical axis.
        across_label: Label with unit.
        up_label: Label with unit.
    """

    quantities: Annotated[tuple[str, ...], Column("rows")]
    slices: Annotated[tuple[str, ...], Column("columns")]
    values: Annotated[Array, Column("rows columns k l", unit="m", nan=True)]
    signed: Annotated[tuple[bool, ...], Column("rows")]
    across: Annotated[Array, Column("l")]
    up: Annotated[Array, Column("k")]
    across_label: str
    up_label: str
    title: str = "Predicted error over the region"
    kind: ClassVar[str] = "map-slices"
    json_keys: ClassVar[Mapping[str, str]] = {"quantities": "quantities", "slices": "slices"}

    def _check_rules(self) -> None:
        """Checks that there is something to draw."""
        if not np.isfinite(self.values).any():
            raise ShapeError("map slices: no finite value.")

    def _json_more(self) -> dict[str, object]:
        return {
            self.across_label: self.across.tolist(),
            self.up_label: self.up.tolist(),
            "values_mm": nullable(self.values / MM),
        }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the slices as small multiples, one scale a row."""
        rows, columns = len(self.quantities), len(self.slices)

        def draw(axes: list[Axes]) -> None:
            for r, quantity in enumerate(self.quantities):
                line = axes[r * columns : (r + 1) * columns]
                cmap, norm = _step_scale(self.values[r] / MM, self.signed[r])
                for c, ax in enumerate(line):
                    mesh = ax.pcolormesh(
                        _cell_edges(self.across), _cell_edges(self.up),
                        np.ma.masked_invalid(self.values[r, c] / MM), cmap=cmap, norm=norm,
                        edgecolors="face", linewidth=0.2,
                    )  # fmt: skip
                    self._frame_slice(ax, r, c)
                bar = line[0].figure.colorbar(mesh, ax=line, shrink=0.9, aspect=14, pad=0.01)
                _style_bar(bar, f"{quantity}, mm")

        width = max(10.0, 2.4 * columns)
        return Drawing(draw=draw, width=width, height=0.6 + 1.75 * rows, panels=columns, rows=rows)

    def _frame_slice(self, ax: Axes, row: int, column: int) -> None:
        """Draws a small cross where the arm cannot go, and the labels a slice needs."""
        up, across = np.nonzero(~np.isfinite(self.values[row, column]))
        if len(up):
            ax.plot(
                self.across[across], self.up[up], "x", color=MUTED, markersize=3.5,
                markeredgewidth=0.8,
            )  # fmt: skip
        first, last = column == 0, row == len(self.quantities) - 1
        ax.grid(visible=False)
        ax.tick_params(labelsize=9.0, labelleft=first, labelbottom=last)
        ax.xaxis.set_major_locator(MaxNLocator(nbins=4))
        ax.yaxis.set_major_locator(MaxNLocator(nbins=4))
        if first:
            ax.set_ylabel(self.up_label, fontsize=10.0)
        if last:
            ax.set_xlabel(self.across_label, fontsize=10.0)
        if row == 0:
            ax.set_title(self.slices[column], fontsize=11.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SideContour(Plot):
    """The outer boundary of a part seen from one side, and the tips that cut.

    Attributes:
        outlines: (k, 2) m each, one per separate body.
        cuts: (n, 2) m, tips that cut, in the same plane.
    """

    outlines: tuple[Array, ...]
    cuts: Annotated[Array, Column("n 2", unit="m")]
    kind: ClassVar[str] = "side-contour"
    json_keys: ClassVar[Mapping[str, str]] = {"cuts_mm": "cuts"}

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the contour with the points inside it, both axes alike."""

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            ax.plot(*(self.cuts / MM).T, ".", color=AFTER, markersize=2.5)
            for outline in self.outlines:
                closed = np.vstack([outline, outline[:1]]) / MM
                ax.plot(*closed.T, "-", color=INK, linewidth=1.4)
            ax.set_xlabel("mm")
            ax.set_ylabel("mm")
            ax.set_aspect("equal", adjustable="datalim")

        return Drawing(draw=draw, height=4.2)

    def _json_more(self) -> dict[str, object]:
        """Returns the outlines."""
        return {"outlines_mm": [(outline / MM).tolist() for outline in self.outlines]}


def _widen(low: float, high: float) -> tuple[float, float]:
    """Returns the ends of a scale so far apart that near-equal values look equal."""
    if high >= LEAST_SPAN * low:
        return low, high
    middle = 0.5 * (low + high)
    return middle / np.sqrt(LEAST_SPAN), middle * np.sqrt(LEAST_SPAN)


def _widen_log(low: float, high: float) -> tuple[float, float]:
    """Returns the same for a logarithmic scale."""
    if high >= LEAST_LOG_SPAN * low:
        return low, high
    middle = np.sqrt(low * high)
    return middle / np.sqrt(LEAST_LOG_SPAN), middle * np.sqrt(LEAST_LOG_SPAN)


def _style_bar(bar: Colorbar, label: str) -> None:
    bar.set_label(label, color=INK)
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=9.0)


def _step_scale(values: Array, signed: bool) -> tuple[Colormap, BoundaryNorm]:
    """Returns round steps over the values, about zero where they have a sign."""
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


def _cell_edges(centre: Array) -> Array:
    """Returns edges of the cells about grid values; a single value gets a default size."""
    if len(centre) == 1:
        half = 0.5 * max(abs(float(centre[0])), 1.0) * 0.1
        return np.array([centre[0] - half, centre[0] + half])
    middle = 0.5 * (centre[1:] + centre[:-1])
    return np.concatenate([[2 * centre[0] - middle[0]], middle, [2 * centre[-1] - middle[-1]]])
