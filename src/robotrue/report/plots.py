"""Plots of errors before and after: at every point, over the space, on a hole, against claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, PercentFormatter

from robotrue.core.arrays import Array
from robotrue.core.columns import Column
from robotrue.core.units import MM
from robotrue.errors import ShapeError
from robotrue.report.content import Plot
from robotrue.report.figure import AFTER, BAND, BEFORE, CAUTION, INK, MUTED, Drawing
from robotrue.report.words import ReportTexts

Plane: TypeAlias = Literal["xy", "xz", "yz"]
PLANES: Final = ("xy", "xz", "yz")
MOST_POINTS: Final = 1500
"""Points drawn at most; a page of 10,000 markers opens slowly and shows no more."""
MOST_ARROWS: Final = 350
MOST_JOINED: Final = 120
"""Points joined by a line, and drawn large, at most."""
_BEFORE_AFTER: Final = {"before_mm": "before", "after_mm": "after"}
_LOOKS: Final = (("before", BEFORE), ("after", AFTER))
"""Attribute and colour of the two states every plot here compares."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointErrors(Plot):
    """Plot of the error length at each point, before and after, in row order.

    Attributes:
        before: (n,) m.
        after: (n,) m.
        axis_label: What is counted along the axis.
        limit: A tolerance in m to draw as a line, None for none.
    """

    before: Annotated[Array, Column("n", unit="m")]
    after: Annotated[Array, Column("n", unit="m")]
    title: str = "Error at every point"
    axis_label: str = "point"
    limit: float | None = None
    kind: ClassVar[str] = "point-errors"
    json_keys: ClassVar[Mapping[str, str]] = _BEFORE_AFTER | {"limit_mm": "limit"}

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the error length at each point, before and after."""
        shown = thin_rows(self.after, MOST_POINTS)
        few = len(shown) <= MOST_JOINED

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            for state, colour in _LOOKS:
                values = getattr(self, state) / MM
                ax.plot(
                    shown + 1, values[shown], "o-" if len(values) <= MOST_JOINED else "o",
                    markersize=4.5 if few else 2.2, markeredgewidth=0.0, linewidth=1.2,
                    color=colour,
                    label=words(f"plot.{state}_stated", mean=values.mean(), max=values.max()),
                )  # fmt: skip
            if self.limit is not None:
                ax.axhline(self.limit / MM, color=CAUTION, linewidth=1.4, linestyle="--")
                ax.annotate(
                    words("plot.limit", limit=self.limit / MM), (1.0, self.limit / MM),
                    xycoords=("axes fraction", "data"), ha="right", va="bottom", color=CAUTION,
                )  # fmt: skip
            ax.set_ylim(bottom=0.0)
            ax.margins(x=0.02)
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
            ax.set_xlabel(self.axis_label)
            ax.set_ylabel(words("plot.error_mm"))
            ax.legend(
                loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2,
                markerscale=1.0 if few else 2.5, handletextpad=0.3,
            )  # fmt: skip

        return Drawing(draw=draw)


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorDistribution(Plot):
    """Plot of the histogram and the cumulative share of error lengths, before and after.

    Attributes:
        before: (n,) m.
        after: (n,) m.
    """

    before: Annotated[Array, Column("n", unit="m")]
    after: Annotated[Array, Column("n", unit="m")]
    title: str = "Distribution of the errors"
    kind: ClassVar[str] = "distribution"
    json_keys: ClassVar[Mapping[str, str]] = _BEFORE_AFTER

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns cumulative shares and a histogram of error lengths."""

        def draw(axes: list[Axes]) -> None:
            cumulative, histogram = axes
            for state, colour in _LOOKS:
                ordered = np.sort(getattr(self, state)) / MM
                share = np.arange(1, len(ordered) + 1) / len(ordered)
                steps = np.unique(np.linspace(0, len(ordered) - 1, 400).astype(int))
                cumulative.plot(
                    ordered[steps], share[steps], color=colour, linewidth=2.0,
                    label=words(f"plot.{state}"), drawstyle="steps-post",
                )  # fmt: skip
            cumulative.axhline(0.95, color=MUTED, linewidth=1.0, linestyle=":")
            cumulative.set_xscale("log")
            cumulative.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            cumulative.yaxis.set_major_formatter(PercentFormatter(1.0))
            cumulative.set_ylim(0.0, 1.02)
            cumulative.set_title(words("plot.share_below"))
            cumulative.set_xlabel(words("plot.error_log"))
            cumulative.legend(loc="center left", bbox_to_anchor=(0.0, 0.75))
            bins = min(40, max(8, int(np.sqrt(len(self.after)))))
            histogram.hist(self.after / MM, bins=bins, color=AFTER, edgecolor=BAND, linewidth=0.5)
            histogram.set_title(words("plot.after"))
            histogram.set_xlabel(words("plot.error_mm"))
            histogram.set_ylabel(words("plot.points"))
            histogram.set_xlim(left=0.0)

        return Drawing(draw=draw, height=3.4, panels=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMap(Plot):
    """Plot of error arrows at their places, before and after side by side.

    Attributes:
        position: (n, 3) m, where, in ``frame``.
        before: (n, 3) m, actual minus commanded.
        after: (n, 3) m.
        plane: Which two axes are drawn.
        magnification: Arrow length over error length; stated in the plot.
        frame: Whose axes, for the labels.
    """

    position: Annotated[Array, Column("n 3", unit="m")]
    before: Annotated[Array, Column("n 3", unit="m")]
    after: Annotated[Array, Column("n 3", unit="m")]
    plane: Plane = "xy"
    magnification: float = 100.0
    frame: str = "base"
    title: str = "Directions of the errors"
    kind: ClassVar[str] = "map"
    json_keys: ClassVar[Mapping[str, str]] = {
        "plane": "plane",
        "position_mm": "position",
    } | _BEFORE_AFTER

    def _check_rules(self) -> None:
        """Checks the plane, and that there is a point."""
        Plot._check_rules(self)
        if self.plane not in PLANES:
            raise ShapeError(f"plane {self.plane!r}, expected one of {PLANES}.")

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns error arrows at their places, before and after."""
        across_up = tuple("xyz".index(name) for name in self.plane)
        shown = thin_rows(np.linalg.norm(self.after, axis=1), MOST_ARROWS)
        place = self.position[shown][:, across_up]

        def draw(axes: list[Axes]) -> None:
            tips = [place]
            for ax, (state, colour) in zip(axes, _LOOKS, strict=True):
                arrow = getattr(self, state)[shown][:, across_up] * self.magnification
                ax.plot(place[:, 0], place[:, 1], ".", color=MUTED, markersize=2.0)
                ax.quiver(
                    place[:, 0], place[:, 1], arrow[:, 0], arrow[:, 1],
                    angles="xy", scale_units="xy", scale=1.0, color=colour,
                    width=0.003, headwidth=3.5, headlength=4.5, headaxislength=4.0,
                )  # fmt: skip
                tips.append(place + arrow)
                name = words(f"plot.{state}")
                ax.set_title(words("plot.arrows", name=name, factor=self.magnification))
                ax.set_xlabel(words("plot.axis", axis=self.plane[0], frame=self.frame))
                ax.set_ylabel(words("plot.axis", axis=self.plane[1], frame=self.frame))
            _set_same_view(axes, np.concatenate(tips))

        return Drawing(draw=draw, height=5.0, panels=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoveragePlot(Plot):
    """Plot of stated against observed probability: is the uncertainty honest?

    Attributes:
        stated: (k,) stated probability of the regions, 0 to 1.
        observed: (k,) share of points inside them.
        low: (k,) lower end of the interval of ``observed``.
        high: (k,) upper end.
    """

    stated: Annotated[Array, Column("k")]
    observed: Annotated[Array, Column("k")]
    low: Annotated[Array, Column("k")]
    high: Annotated[Array, Column("k")]
    title: str = "Check of the stated uncertainty"
    kind: ClassVar[str] = "coverage"
    json_keys: ClassVar[Mapping[str, str]] = {
        name: name for name in ("stated", "observed", "low", "high")
    }

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns stated against observed probability."""

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            ax.plot([0, 1], [0, 1], "--", color=MUTED, linewidth=1.2, label=words("plot.honest"))
            ax.fill_between(
                self.stated, self.low, self.high, color=BAND, linewidth=0.0,
                label=words("plot.interval"),
            )  # fmt: skip
            ax.plot(
                self.stated, self.observed, "o-", color=AFTER, linewidth=1.8, markersize=4.5,
                label=words("plot.observed"),
            )  # fmt: skip
            ax.set_xlim(0.0, 1.02)
            ax.set_ylim(0.0, 1.02)
            ax.set_aspect("equal")
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_formatter(PercentFormatter(1.0))
            ax.set_xlabel(words("plot.stated"))
            ax.set_ylabel(words("plot.inside"))
            ax.legend(loc="center left", bbox_to_anchor=(1.03, 0.5))

        return Drawing(draw=draw, height=4.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleContour(Plot):
    """Plot of a circular contour, deviations magnified, before and after.

    Attributes:
        radius: m, of the commanded circle.
        angle: (n,) rad, of each point on it.
        before: (n, 2) m, in-plane deviation of each point, actual minus commanded.
        after: (n, 2) m.
        magnification: Drawn over true deviation; stated in the plot.
        limit: Tolerance in m, drawn (magnified too) as a band, None for none.
    """

    radius: float
    angle: Annotated[Array, Column("n", unit="rad")]
    before: Annotated[Array, Column("n 2", unit="m")]
    after: Annotated[Array, Column("n 2", unit="m")]
    magnification: float = 20.0
    limit: float | None = None
    title: str = "Contour of the hole"
    kind: ClassVar[str] = "hole-contour"
    json_keys: ClassVar[Mapping[str, str]] = (
        {"radius_mm": "radius", "angle_deg": "angle"} | _BEFORE_AFTER | {"limit_mm": "limit"}
    )

    def _check_rules(self) -> None:
        """Checks the radius, and that there is a point."""
        Plot._check_rules(self)
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise ShapeError(f"radius {self.radius} m, expected a positive length.")

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the contour with magnified deviations, before and after."""
        commanded = self.radius * np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1) / MM
        band = 0.0 if self.limit is None else self.limit * self.magnification / MM

        def draw(axes: list[Axes]) -> None:
            tips = [commanded]
            for ax, (state, colour) in zip(axes, _LOOKS, strict=True):
                deviation = self.magnification * getattr(self, state) / MM
                if self.limit is not None:
                    for offset in (-band, band):
                        _draw_circle(ax, self.radius / MM + offset, "--", CAUTION, 0.9)
                _draw_circle(ax, self.radius / MM, "-", MUTED, 1.0)
                tips.append(commanded + deviation)
                _draw_contour(ax, tips[-1], self.angle, colour)
                ax.plot(0, 0, "+", color=MUTED, markersize=9)
                ax.plot(*deviation.mean(axis=0), "x", color=colour, markersize=7)
                name = words(f"plot.{state}")
                title = words("plot.deviations", name=name, factor=self.magnification)
                ax.set_title(title, color=INK)
                ax.set_xlabel(words("plot.hole_plane"))
            _set_same_view(axes, np.concatenate(tips))

        return Drawing(draw=draw, height=5.2, panels=2)


def _set_same_view(axes: list[Axes], points: Array) -> None:
    """Gives all axes the same limits around the points, one metre as long one way as the other."""
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.05 * max(float((high - low).max()), 1e-9)
    for ax in axes:
        ax.set_xlim(low[0] - pad, high[0] + pad)
        ax.set_ylim(low[1] - pad, high[1] + pad)
        ax.set_aspect("equal", adjustable="box")


def _draw_circle(ax: Axes, radius: float, style: str, colour: str, linewidth: float) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    ax.plot(x, y, style, color=colour, linewidth=linewidth)


def _draw_contour(ax: Axes, tip: Array, angle: Array, colour: str) -> None:
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
