"""Figures of the library: the drawings of the reports, one below the other."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.report.figure import AFTER, BEFORE, MUTED, Drawing, stack_drawings

DOTS_PER_INCH: Final = 100
VIEWS: Final = ((0, 1, "x", "y"), (0, 2, "x", "z"))
"""Axes across and up of the two views of a place: from above, and from the side."""
ARROW: Final = 0.08
"""Length of the largest arrow, as a share of the extent of the places."""


class Picture(Figure):
    """A matplotlib figure that notebooks show without pyplot; ``savefig(path)`` writes it."""

    def _repr_png_(self) -> bytes:
        """Returns the figure as PNG."""
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
        return stream.getvalue()


def make_picture(drawings: Sequence[Drawing], *, title: str = "") -> Picture:
    """Returns drawings below each other, under one line of text."""
    return stack_drawings(Picture, drawings, title=title)


def draw_views(draw_view: Callable[[Axes, int, int], None], name: str) -> Drawing:
    """Returns two views, from above and from the side, in mm.

    Args:
        draw_view: Draws on axes, given the columns across and up.
        name: Whose frame it is, for the labels.
    """

    def draw(axes: list[Axes]) -> None:
        for ax, (across, up, right, top) in zip(axes, VIEWS, strict=True):
            draw_view(ax, across, up)
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel(f"{right} in mm ({name})")
            ax.set_ylabel(f"{top} in mm")

    return Drawing(draw=draw, height=4.6, panels=2)


def draw_places(position: Array, name: str) -> Drawing:
    """Returns points (n, 3) m from above and from the side."""

    def draw_view(ax: Axes, across: int, up: int) -> None:
        ax.plot(position[:, across] / MM, position[:, up] / MM, ".", color=AFTER, markersize=4)

    return draw_views(draw_view, name)


def draw_path(position: Array, changed: IntArray, name: str) -> Drawing:
    """Returns a path (n, 3) m with some of its rows marked."""

    def draw_view(ax: Axes, across: int, up: int) -> None:
        place = position / MM
        ax.plot(place[:, across], place[:, up], "-", color=MUTED, linewidth=0.8)
        ax.plot(place[changed, across], place[changed, up], ".", color=AFTER, markersize=2.5)

    return draw_views(draw_view, name)


def draw_arrows(position: Array, error: Array, name: str) -> Drawing:
    """Returns errors (n, 3) m as enlarged arrows at their places (n, 3) m."""
    longest = float(np.linalg.norm(error, axis=1).max(initial=1e-9))
    extent = max(float(np.ptp(position, axis=0).max()), 0.1)
    factor = float(f"{ARROW * extent / longest:.1g}")

    def draw_view(ax: Axes, across: int, up: int) -> None:
        place, arrow = position / MM, factor * error / MM
        ax.plot(place[:, across], place[:, up], ".", color=MUTED, markersize=2)
        ax.quiver(
            place[:, across], place[:, up], arrow[:, across], arrow[:, up], angles="xy",
            scale_units="xy", scale=1.0, color=BEFORE, width=0.003,
        )  # fmt: skip
        ax.set_title(f"errors, {factor:g} times enlarged")

    return draw_views(draw_view, name)


def draw_intervals(
    labels: Sequence[str], value: Array, radius: Array, unit: str, title: str
) -> Drawing:
    """Returns values with intervals of plus and minus ``radius``, one row per label."""

    def draw(axes: list[Axes]) -> None:
        (ax,) = axes
        rows = np.arange(len(labels))
        ax.errorbar(value, rows, xerr=radius, fmt="o", color=AFTER, markersize=4, capsize=2)
        ax.axvline(0.0, color=MUTED, linewidth=1.0)
        ax.set_yticks(rows, list(labels))
        ax.invert_yaxis()
        ax.set_xlabel(unit)
        ax.set_title(title)

    return Drawing(draw=draw, height=1.1 + 0.22 * len(labels))


def draw_bars(labels: Sequence[str], value: Array, title: str) -> Drawing:
    """Returns one bar per label."""

    def draw(axes: list[Axes]) -> None:
        (ax,) = axes
        ax.barh(np.arange(len(labels)), value, color=AFTER)
        ax.set_yticks(np.arange(len(labels)), list(labels))
        ax.invert_yaxis()
        ax.set_title(title)

    return Drawing(draw=draw, height=1.1 + 0.3 * len(labels))
