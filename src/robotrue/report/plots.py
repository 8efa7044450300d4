"""The drawings of a report, one function per kind of block."""

from __future__ import annotations

from html import escape

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, PercentFormatter

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.report.content import (
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    HoleContour,
    PointErrors,
)
from robotrue.report.figure import AFTER, BAND, BEFORE, CAUTION, INK, MUTED, inline_svg
from robotrue.report.words import ENGLISH, Words

MOST_POINTS = 1500
"""Points drawn at most; a page of 10,000 markers opens slowly and shows no more."""
MOST_ARROWS = 350


def point_errors_svg(plot: PointErrors, key: str, words: Words = ENGLISH) -> str:
    """Returns the error length at each point, before and after, as SVG."""
    shown = thin_rows(plot.after, MOST_POINTS)

    def draw(axes: list[Axes]) -> None:
        (ax,) = axes
        for values, colour, label in (
            (plot.before, BEFORE, "plot.before_stated"),
            (plot.after, AFTER, "plot.after_stated"),
        ):
            line = "-" if len(values) <= 120 else "none"
            ax.plot(
                shown + 1,
                values[shown] / MM,
                linestyle=line,
                marker="o",
                markersize=4.5 if len(shown) <= 120 else 2.2,
                markeredgewidth=0.0,
                linewidth=1.2,
                color=colour,
                label=words(label, mean=values.mean() / MM, max=values.max() / MM),
            )
        if plot.limit is not None:
            ax.axhline(plot.limit / MM, color=CAUTION, linewidth=1.4, linestyle="--")
            ax.annotate(
                words("plot.limit", limit=plot.limit / MM),
                (1.0, plot.limit / MM),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                color=CAUTION,
            )
        ax.set_ylim(bottom=0.0)
        ax.margins(x=0.02)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlabel(plot.axis_label)
        ax.set_ylabel(words("plot.error_mm"))
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=2,
            borderaxespad=0.2,
            markerscale=1.0 if len(shown) <= 120 else 2.5,
            handletextpad=0.3,
        )

    return inline_svg(draw, key=key, label=escape(plot.title, quote=True))


def distribution_svg(plot: ErrorDistribution, key: str, words: Words = ENGLISH) -> str:
    """Returns cumulative shares and a histogram of error lengths as SVG."""

    def draw(axes: list[Axes]) -> None:
        cumulative, histogram = axes
        for values, colour, label in (
            (plot.before, BEFORE, words("plot.before")),
            (plot.after, AFTER, words("plot.after")),
        ):
            ordered = np.sort(values) / MM
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            keep = np.unique(np.linspace(0, len(ordered) - 1, 400).astype(int))
            cumulative.plot(
                ordered[keep], share[keep], color=colour, linewidth=2.0, label=label,
                drawstyle="steps-post",
            )  # fmt: skip
        cumulative.axhline(0.95, color=MUTED, linewidth=1.0, linestyle=":")
        cumulative.set_xscale("log")
        cumulative.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        cumulative.yaxis.set_major_formatter(PercentFormatter(1.0))
        cumulative.set_ylim(0.0, 1.02)
        cumulative.set_title(words("plot.share_below"))
        cumulative.set_xlabel(words("plot.error_log"))
        cumulative.legend(loc="center left", bbox_to_anchor=(0.0, 0.75))
        bins = min(40, max(8, int(np.sqrt(len(plot.after)))))
        histogram.hist(plot.after / MM, bins=bins, color=AFTER, edgecolor=BAND, linewidth=0.5)
        histogram.set_title(words("plot.after"))
        histogram.set_xlabel(words("plot.error_mm"))
        histogram.set_ylabel(words("plot.points"))
        histogram.set_xlim(left=0.0)

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=3.4, panels=2)


def map_svg(plot: ErrorMap, key: str, words: Words = ENGLISH) -> str:
    """Returns error arrows at their places, before and after, as SVG."""
    first, second = ("xyz".index(name) for name in plot.plane)
    longest = np.linalg.norm(plot.after, axis=1)
    shown = thin_rows(longest, MOST_ARROWS)
    place = plot.position[shown][:, (first, second)]

    def draw(axes: list[Axes]) -> None:
        tips = [place]
        for ax, vectors, colour, label in (
            (axes[0], plot.before, BEFORE, words("plot.before")),
            (axes[1], plot.after, AFTER, words("plot.after")),
        ):
            arrow = vectors[shown][:, (first, second)] * plot.magnification
            ax.plot(place[:, 0], place[:, 1], ".", color=MUTED, markersize=2.0)
            ax.quiver(
                place[:, 0], place[:, 1], arrow[:, 0], arrow[:, 1],
                angles="xy", scale_units="xy", scale=1.0, color=colour,
                width=0.003, headwidth=3.5, headlength=4.5, headaxislength=4.0,
            )  # fmt: skip
            tips.append(place + arrow)
            ax.set_title(words("plot.arrows", name=label, factor=plot.magnification))
            ax.set_xlabel(words("plot.axis", axis="xyz"[first], frame=plot.frame))
            ax.set_ylabel(words("plot.axis", axis="xyz"[second], frame=plot.frame))
        _same_view(axes, np.concatenate(tips))

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=5.0, panels=2)


def coverage_svg(plot: CoveragePlot, key: str, words: Words = ENGLISH) -> str:
    """Returns stated against observed probability as SVG."""

    def draw(axes: list[Axes]) -> None:
        (ax,) = axes
        ax.plot(
            [0, 1], [0, 1], color=MUTED, linewidth=1.2, linestyle="--", label=words("plot.honest")
        )
        ax.fill_between(plot.stated, plot.low, plot.high, color=BAND, linewidth=0.0,
                        label=words("plot.interval"))  # fmt: skip
        ax.plot(plot.stated, plot.observed, "o-", color=AFTER, linewidth=1.8, markersize=4.5,
                label=words("plot.observed"))  # fmt: skip
        ax.set_xlim(0.0, 1.02)
        ax.set_ylim(0.0, 1.02)
        ax.set_aspect("equal")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(PercentFormatter(1.0))
        ax.set_xlabel(words("plot.stated"))
        ax.set_ylabel(words("plot.inside"))
        ax.legend(loc="center left", bbox_to_anchor=(1.03, 0.5))

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=4.2)


def hole_svg(plot: HoleContour, key: str, words: Words = ENGLISH) -> str:
    """Returns the contour of a circle with magnified deviations, before and after, as SVG."""
    unit = np.stack([np.cos(plot.angle), np.sin(plot.angle)], axis=1)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)

    def draw(axes: list[Axes]) -> None:
        tips = [plot.radius / MM * unit]
        for ax, deviation, colour, label in (
            (axes[0], plot.before, BEFORE, words("plot.before")),
            (axes[1], plot.after, AFTER, words("plot.after")),
        ):
            if plot.limit is not None:
                half = plot.limit * plot.magnification / MM
                for side, style in ((-half, "--"), (half, "--")):
                    ring = plot.radius / MM + side
                    ax.plot(ring * np.cos(turn), ring * np.sin(turn), style, color=CAUTION,
                            linewidth=0.9)  # fmt: skip
            ring = plot.radius / MM
            ax.plot(ring * np.cos(turn), ring * np.sin(turn), color=MUTED, linewidth=1.0)
            tip = (plot.radius * unit + plot.magnification * deviation) / MM
            _closed_path(ax, tip, plot.angle, colour)
            tips.append(tip)
            centre = plot.magnification * deviation.mean(axis=0) / MM
            ax.plot(0, 0, "+", color=MUTED, markersize=9)
            ax.plot(*centre, "x", color=colour, markersize=7)
            ax.set_title(words("plot.deviations", name=label, factor=plot.magnification), color=INK)
            ax.set_xlabel(words("plot.hole_plane"))
        _same_view(axes, np.concatenate(tips))

    label = escape(plot.title, quote=True)
    return inline_svg(draw, key=key, label=label, height=5.2, panels=2)


def _same_view(axes: list[Axes], points: Array) -> None:
    """Gives all axes the same limits around the points, one metre as long one way as the other."""
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.05 * max(float((high - low).max()), 1e-9)
    for ax in axes:
        ax.set_xlim(low[0] - pad, high[0] + pad)
        ax.set_ylim(low[1] - pad, high[1] + pad)
        ax.set_aspect("equal", adjustable="box")


def _closed_path(ax: Axes, tip: Array, angle: Array, colour: str) -> None:
    """Draws points in the order of their angle; joined up if they go all the way round."""
    ordered = tip[np.argsort(angle % (2.0 * np.pi), kind="stable")]
    gap = np.diff(np.sort(angle % (2.0 * np.pi)))
    if len(gap) and gap.max() < 0.6:
        ordered = np.concatenate([ordered, ordered[:1]])
    ax.plot(ordered[:, 0], ordered[:, 1], "o-", color=colour, linewidth=1.6, markersize=3.5)


def thin_rows(values: Array, most: int) -> npt.NDArray[np.int64]:
    """Returns at most ``most`` row indices: evenly spaced, and always the largest values."""
    n = len(values)
    if n <= most:
        return np.arange(n)
    worst = np.argsort(-values, kind="stable")[: most // 10]
    even = np.linspace(0, n - 1, most - len(worst)).astype(np.int64)
    return np.unique(np.concatenate([even, worst]))
