"""Plots along one axis: accuracy against poses, a budget's contributions, tilt against causes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import Annotated, ClassVar, Final, Literal, TypedDict

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, PercentFormatter

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ShapeError
from robotrue.report.content import Plot, nullable
from robotrue.report.figure import AFTER, BAD, BAND, BEFORE, CAUTION, GOOD, INK, MUTED, Drawing
from robotrue.report.words import ReportTexts

PEERS: Final = (
    (BEFORE, "s", "--"),
    (GOOD, "^", "-."),
    (CAUTION, "D", ":"),
    (BAD, "v", "--"),
    (MUTED, "P", "-."),
)
"""Colour, mark and line of the peers in turn, distinguishable without colour."""
_TICKS: Final = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0,
                 5.0, 7.0, 10.0, 20.0, 50.0, 100.0)  # fmt: skip
MOST_TICKS: Final = 10
BAR_HEIGHT: Final = 0.42
"""Inches a bar takes."""
SMALLEST_TILT: Final = 1e-4
"""deg, where the logarithmic axis begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSeries(Columns):
    """One curve against the number of poses.

    Attributes:
        label: Name in the legend.
        count: (k,) numbers of poses, rising.
        median: (k,) m; NaN where there is none.
        low: (k,) m, lower quartile; empty without a band.
        high: (k,) m, upper quartile; empty without a band.
        coverage: (k,) share in the stated 95 % regions; empty if it was not measured.
        role: ``ours`` is set off, ``peer`` is compared with, ``published`` are printed numbers of
            others, drawn as marks.
    """

    label: str
    count: Annotated[Array, Column("k")]
    median: Annotated[Array, Column("k", unit="m", nan=True)]
    low: Annotated[Array, Column("_", unit="m", nan=True)] = EMPTY
    high: Annotated[Array, Column("_", unit="m", nan=True)] = EMPTY
    coverage: Annotated[Array, Column("_", nan=True)] = EMPTY
    role: Literal["ours", "peer", "published"] = "peer"

    def _check_rules(self) -> None:
        """Checks that bands and coverage are empty or have a value for each count."""
        k = len(self.count)
        sizes = [len(self.low), len(self.high), len(self.coverage)]
        if not k or sizes[0] != sizes[1] or not set(sizes) <= {0, k}:
            raise ShapeError(f"series {self.label!r}: no points, or half a band.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCurves(Plot):
    """Plot of accuracy, and of coverage where measured, against the number of poses.

    Attributes:
        series: One curve each; bands are quartiles over repeats.
        floor: m, what nothing can beat (noise of the check itself); None if it is not known.
        axis_label: What is counted.
    """

    series: tuple[PoseSeries, ...]
    floor: float | None = None
    axis_label: str = "poses"
    title: str = "Accuracy against the number of poses"
    kind: ClassVar[str] = "pose-curves"
    json_keys: ClassVar[Mapping[str, str]] = {"floor_mm": "floor"}

    def _check_rules(self) -> None:
        """Checks that there is something to draw."""
        if not any(np.isfinite(s.median).any() for s in self.series):
            raise ShapeError("pose curves: no finite value in any series.")

    def _json_more(self) -> dict[str, object]:
        return {
            "series": [
                {
                    "label": series.label,
                    "role": series.role,
                    "count": series.count.tolist(),
                    "median_mm": nullable(series.median / MM),
                    "low_mm": nullable(series.low / MM),
                    "high_mm": nullable(series.high / MM),
                    "coverage_95": nullable(series.coverage),
                }
                for series in self.series
            ]
        }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns accuracy, and coverage where measured, against the number of poses."""
        counts = np.unique(np.concatenate([s.count for s in self.series]))
        even = bool(counts[0] <= 0.0)  # zero has no place on a logarithmic axis: equal steps

        def place(count: Array) -> Array:
            return np.asarray(np.searchsorted(counts, count), dtype=np.float64) if even else count

        def draw(axes: list[Axes]) -> None:
            for series, look in zip(self.series, _assign_looks(self.series), strict=True):
                x = place(series.count)
                if series.low.size:
                    axes[0].fill_between(
                        x, series.low / MM, series.high / MM, color=look["color"], alpha=0.13, lw=0
                    )
                axes[0].plot(x, series.median / MM, label=series.label, **look)
                if len(axes) > 1 and series.coverage.size:
                    axes[1].plot(x, series.coverage, **look)
            self._scale_errors(axes[0])
            if len(axes) > 1:
                _scale_coverage(axes[1])
            for ax in axes:
                if not even:
                    ax.set_xscale("log")
                _tick_counts(ax, counts, place(counts))
                ax.set_xlabel(self.axis_label)
            axes[0].legend(
                loc="upper left", bbox_to_anchor=(0.0, -0.17), ncols=3, borderaxespad=0.0,
                fontsize=10.0,
            )  # fmt: skip

        panels = 2 if any(s.coverage.size for s in self.series) else 1
        return Drawing(draw=draw, height=4.6, panels=panels)

    def _scale_errors(self, ax: Axes) -> None:
        values = np.concatenate([np.r_[s.median, s.low, s.high] for s in self.series]) / MM
        values = values[np.isfinite(values) & (values > 0.0)]
        low, high = values.min(), values.max()
        if self.floor is not None:
            floor = self.floor / MM
            low = min(low, floor)
            ax.axhline(floor, color=MUTED, linewidth=1.4, linestyle=(0, (5, 3)), zorder=1)
            ax.annotate(
                f"floor {floor:.3f} mm", (1.0, floor), xycoords=("axes fraction", "data"),
                ha="right", va="bottom", color=MUTED, fontsize=10.0,
            )  # fmt: skip
        ax.set_yscale("log")
        ax.set_ylim(0.85 * low, 1.15 * high)
        ticks = [t for t in _TICKS if 0.85 * low <= t <= 1.15 * high]
        ax.yaxis.set_major_locator(FixedLocator(ticks))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.set_title("mean error, mm")


class Look(TypedDict):
    """Style of a curve in Matplotlib."""

    color: str
    marker: str
    linestyle: str
    linewidth: float
    markersize: float
    markeredgewidth: float


def _assign_looks(series: tuple[PoseSeries, ...]) -> list[Look]:
    """Returns the line style of each curve: ours set off, peers in turn."""
    peers = cycle(PEERS)
    looks: list[Look] = []
    for curve in series:
        match curve.role:
            case "ours":
                color, marker, style, width, size = AFTER, "o", "-", 2.6, 7.0
            case "published":
                color, marker, style, width, size = INK, "*", "none", 0.0, 12.0
            case "peer":
                (color, marker, style), width, size = next(peers), 1.5, 5.0
        looks.append(
            Look(
                color=color,
                marker=marker,
                linestyle=style,
                linewidth=width,
                markersize=size,
                markeredgewidth=0.0,
            )
        )
    return looks


def _scale_coverage(ax: Axes) -> None:
    ax.axhspan(0.93, 0.97, color=BAND, linewidth=0.0, zorder=0)
    ax.axhline(0.95, color=MUTED, linewidth=1.0, linestyle=":")
    ax.set_ylim(min(0.6, ax.get_ylim()[0]), 1.01)
    ax.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    ax.set_title("share in the stated 95 % regions")


def _tick_counts(ax: Axes, counts: Array, place: Array) -> None:
    step = -(-len(counts) // MOST_TICKS)
    ax.xaxis.set_major_locator(FixedLocator(place[::step].tolist()))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xticklabels([f"{count:g}" for count in counts[::step]])


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetPlot(Plot):
    """Plot of the contributions to a combined uncertainty.

    Attributes:
        names: Of the contributions, as printed.
        value: (n,) m, standard uncertainty of each.
        combined: m.
        combined_name: Its printed name.
    """

    names: Annotated[tuple[str, ...], Column("n")]
    value: Annotated[Array, Column("n", unit="m")]
    combined: float
    combined_name: str
    kind: ClassVar[str] = "budget"
    json_keys: ClassVar[Mapping[str, str]] = {
        "names": "names",
        "standard_uncertainty_mm": "value",
        "combined_mm": "combined",
    }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns one bar for each contribution and one for the sum."""
        names = (*self.names, self.combined_name)
        value = np.append(self.value, self.combined) / UM

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            place = np.arange(len(names))[::-1]
            ax.barh(place, value, height=0.62, color=[*[AFTER] * len(self.names), INK])
            reach = float(value.max())
            for y, name, v in zip(place, names, value, strict=True):
                ax.text(-0.015 * reach, y, name, ha="right", va="center", color=INK)
                ax.text(v + 0.01 * reach, y, f"{v:.1f}", ha="left", va="center", color=MUTED)
            ax.set_yticks([])
            ax.spines["left"].set_visible(False)
            ax.grid(visible=False, axis="y")
            ax.set_xlim(0.0, 1.1 * reach)
            ax.set_xlabel(words("plot.uncertainty"))

        return Drawing(draw=draw, height=0.9 + BAR_HEIGHT * len(names))


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltPlot(Plot):
    """Plot of residual tilt before and after correction.

    Attributes:
        before: (n, 2) rad, tilt left about x and y without correction.
        after: (n, 2) rad, with it.
        force: (n,) N, clamp force.
        tilt: (n,) rad, size of the tilt to be removed.
        limit: rad, required limit; None for none.
    """

    before: Annotated[Array, Column("n 2", unit="rad")]
    after: Annotated[Array, Column("n 2", unit="rad")]
    force: Annotated[Array, Column("n", unit="N")]
    tilt: Annotated[Array, Column("n", unit="rad")]
    limit: float | None = None
    title: str = "Residual tilt after one move"
    kind: ClassVar[str] = "tilt"
    json_keys: ClassVar[Mapping[str, str]] = {
        "before_deg": "before",
        "after_deg": "after",
        "force_N": "force",
        "tilt_deg": "tilt",
        "limit_deg": "limit",
    }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns residuals against force and against tilt, and about both axes."""
        looks = (
            (self.before / DEG, BEFORE, words("plot.before")),
            (self.after / DEG, AFTER, words("plot.after")),
        )

        def draw(axes: list[Axes]) -> None:
            causes = ((self.force, "plot.force"), (self.tilt / DEG, "plot.tilt"))
            for ax, (cause, label) in zip(axes, causes, strict=False):
                for residual, colour, name in looks:
                    size = np.hypot(*residual.T)
                    legend = words("plot.mean_deg", name=name, mean=size.mean())
                    ax.plot(cause, size, ".", color=colour, markersize=4.0, label=legend)
                if self.limit is not None:
                    ax.axhline(self.limit / DEG, color=CAUTION, linewidth=1.4, linestyle="--")
                ax.set_yscale("log")
                ax.set_ylim(bottom=SMALLEST_TILT)
                ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
                ax.set_xlabel(words(label))
            axes[0].set_title(words("plot.left"))
            axes[0].legend(loc="upper left", bbox_to_anchor=(-0.05, -0.2), ncols=1, fontsize=10.0)
            for residual, colour, _ in looks:
                axes[2].plot(*residual.T, ".", color=colour, markersize=4.0)
            _draw_bullseye(axes[2], self)
            axes[2].set_title(words("plot.about"))

        return Drawing(draw=draw, height=4.2, panels=3)


def _draw_bullseye(ax: Axes, plot: TiltPlot) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for ring in (0.1, 0.5) if plot.limit is None else (plot.limit / DEG,):
        ax.plot(ring * np.cos(turn), ring * np.sin(turn), color=MUTED, linewidth=1.0)
    reach = 1.08 * float(np.abs([plot.before, plot.after]).max()) / DEG
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
