"""Tilt left after one move, against the causes of the readings' errors, and its bull's-eye."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Annotated, Final

import numpy as np
from matplotlib.axes import Axes

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.report.figure import AFTER, BEFORE, CAUTION, MUTED, inline_svg
from robotrue.report.words import ENGLISH, Words

SMALLEST: Final = 1e-4
"""deg, where the logarithmic axis begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltPlot(Columns):
    """Plot of residual tilt before and after correction.

    Attributes:
        before: (n, 2) rad, tilt left about x and y without correction.
        after: (n, 2) rad, with it.
        force: (n,) N, clamp force.
        tilt: (n,) rad, size of the tilt that was to be taken out.
        limit: rad, what is asked for; None for none.
        title: Heading.
        caption: One sentence.
    """

    before: Annotated[Array, Column("n 2", unit="rad")]
    after: Annotated[Array, Column("n 2", unit="rad")]
    force: Annotated[Array, Column("n", unit="N")]
    tilt: Annotated[Array, Column("n", unit="rad")]
    limit: float | None = None
    title: str = "Tilt left after one move"
    caption: str = ""


def tilt_svg(plot: TiltPlot, key: str, words: Words = ENGLISH) -> str:
    """Returns residuals against force and against tilt, and about both axes, as SVG."""
    looks = (
        (plot.before, BEFORE, words("plot.before")),
        (plot.after, AFTER, words("plot.after")),
    )

    def draw(axes: list[Axes]) -> None:
        for ax, cause, label in (
            (axes[0], plot.force, words("plot.force")),
            (axes[1], plot.tilt / DEG, words("plot.tilt")),
        ):
            for left, colour, name in looks:
                size = np.hypot(*left.T) / DEG
                ax.plot(
                    cause, size, ".", color=colour, markersize=4.0,
                    label=words("plot.mean_deg", name=name, mean=size.mean()),
                )  # fmt: skip
            if plot.limit is not None:
                ax.axhline(plot.limit / DEG, color=CAUTION, linewidth=1.4, linestyle="--")
            ax.set_yscale("log")
            ax.set_ylim(bottom=SMALLEST)
            ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            ax.set_xlabel(label)
        axes[0].set_title(words("plot.left"))
        axes[0].legend(loc="upper left", bbox_to_anchor=(-0.05, -0.2), ncols=1, fontsize=10.0)
        _bullseye(axes[2], plot)
        axes[2].set_title(words("plot.about"))

    return inline_svg(draw, key=key, label=escape(plot.title, quote=True), height=4.2, panels=3)


def _bullseye(ax: Axes, plot: TiltPlot) -> None:
    for left, colour in ((plot.before, BEFORE), (plot.after, AFTER)):
        ax.plot(*(left.T / DEG), ".", color=colour, markersize=4.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for ring in (0.1, 0.5) if plot.limit is None else (plot.limit / DEG,):
        ax.plot(ring * np.cos(turn), ring * np.sin(turn), color=MUTED, linewidth=1.0)
    reach = 1.08 * float(np.abs([plot.before, plot.after]).max()) / DEG
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
