"""Accuracy against the number of poses: the drawing and how results become its curves."""

from __future__ import annotations

from html import escape
from itertools import cycle
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, PercentFormatter

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.report.content import PoseCurves, PoseSeries
from robotrue.report.figure import (
    AFTER,
    BAD,
    BAND,
    BEFORE,
    CAUTION,
    GOOD,
    INK,
    MUTED,
    inline_svg,
    png,
)
from robotrue.validation.learning_curve import LearningCurve

PEERS: Final = (
    (BEFORE, "s", "--"),
    (GOOD, "^", "-."),
    (CAUTION, "D", ":"),
    (BAD, "v", "--"),
    (MUTED, "P", "-."),
)
"""Colour, mark and line of the peers in turn: told apart without colour too."""
_TICKS: Final = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0,
                 5.0, 7.0, 10.0, 20.0, 50.0, 100.0)  # fmt: skip
MOST_TICKS: Final = 10


def curves_of(curve: LearningCurve, winner: str, *, title: str, caption: str = "") -> PoseCurves:
    """Returns the plot of a learning curve: medians, quartiles over repeats, coverage."""
    low, median, high = curve.quartiles()
    inside = np.full(median.shape, np.nan)
    known = np.isfinite(median)
    inside[known] = np.nanmedian(curve.coverage[known], axis=1)
    return PoseCurves(
        series=tuple(
            PoseSeries(
                label=name,
                count=curve.counts.astype(np.float64),
                median=median[c],
                low=low[c],
                high=high[c],
                coverage=inside[c],
                role="ours" if name == winner else "peer",
            )
            for c, name in enumerate(curve.names)
        ),
        floor=curve.floor,
        axis_label="target poses",
        title=title,
        caption=caption,
    )


def pose_curves_svg(plot: PoseCurves, key: str) -> str:
    """Returns accuracy, and coverage where measured, against the number of poses as SVG."""
    label = escape(plot.title, quote=True)
    return inline_svg(_drawing(plot), key=key, label=label, height=4.6, panels=_panels(plot))


def pose_curves_png(plot: PoseCurves) -> bytes:
    """Returns the same as a PNG picture."""
    return png(_drawing(plot), height=4.8, panels=_panels(plot), title=plot.title)


def _panels(plot: PoseCurves) -> int:
    return 2 if any(s.coverage.size for s in plot.series) else 1


def _drawing(plot: PoseCurves) -> Any:
    counts = np.unique(np.concatenate([s.count for s in plot.series]))
    even = bool(counts[0] <= 0.0)  # zero has no place on a logarithmic axis: equal steps instead

    def place(count: Array) -> Array:
        return np.asarray(np.searchsorted(counts, count), dtype=np.float64) if even else count

    def draw(axes: list[Axes]) -> None:
        for series, look in zip(plot.series, _looks(plot.series), strict=True):
            x = place(series.count)
            if series.low.size:
                axes[0].fill_between(
                    x, series.low / MM, series.high / MM, color=look["color"], alpha=0.13, lw=0.0
                )
            axes[0].plot(x, series.median / MM, label=series.label, **look)
            if len(axes) > 1 and series.coverage.size:
                axes[1].plot(x, series.coverage, **look)
        _errors(axes[0], plot)
        if len(axes) > 1:
            _coverage(axes[1])
        for ax in axes:
            _counts(ax, counts, place(counts), even, plot.axis_label)
        axes[0].legend(
            loc="upper left", bbox_to_anchor=(0.0, -0.17), ncols=3, borderaxespad=0.0, fontsize=10.0
        )

    return draw


def _looks(series: tuple[PoseSeries, ...]) -> list[dict[str, Any]]:
    peers = cycle(PEERS)
    out: list[dict[str, Any]] = []
    for one in series:
        if one.role == "ours":
            look = (AFTER, "o", "-", 2.6, 7.0)
        elif one.role == "published":
            look = (INK, "*", "none", 0.0, 12.0)
        else:
            look = (*next(peers), 1.5, 5.0)
        names = ("color", "marker", "linestyle", "linewidth", "markersize")
        out.append({**dict(zip(names, look, strict=True)), "markeredgewidth": 0.0})
    return out


def _errors(ax: Axes, plot: PoseCurves) -> None:
    values = np.concatenate([np.r_[s.median, s.low, s.high] for s in plot.series]) / MM
    values = values[np.isfinite(values) & (values > 0.0)]
    low, high = values.min(), values.max()
    if plot.floor is not None:
        low = min(low, plot.floor / MM)
        ax.axhline(plot.floor / MM, color=MUTED, linewidth=1.4, linestyle=(0, (5, 3)), zorder=1)
        ax.annotate(
            f"floor {plot.floor / MM:.3f} mm", (1.0, plot.floor / MM),
            xycoords=("axes fraction", "data"), ha="right", va="bottom", color=MUTED, fontsize=10.0,
        )  # fmt: skip
    ax.set_yscale("log")
    ax.set_ylim(0.85 * low, 1.15 * high)
    ticks = [t for t in _TICKS if 0.85 * low <= t <= 1.15 * high]
    ax.yaxis.set_major_locator(FixedLocator(ticks))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.set_title("mean error, mm")


def _coverage(ax: Axes) -> None:
    ax.axhspan(0.93, 0.97, color=BAND, linewidth=0.0, zorder=0)
    ax.axhline(0.95, color=MUTED, linewidth=1.0, linestyle=":")
    ax.set_ylim(min(0.6, ax.get_ylim()[0]), 1.01)
    ax.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    ax.set_title("share in the stated 95 % regions")


def _counts(ax: Axes, counts: Array, at: Array, even: bool, label: str) -> None:
    if not even:
        ax.set_xscale("log")
    step = -(-len(counts) // MOST_TICKS)
    ax.xaxis.set_major_locator(FixedLocator(at[::step].tolist()))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xticklabels([f"{count:g}" for count in counts[::step]])
    ax.set_xlabel(label)
