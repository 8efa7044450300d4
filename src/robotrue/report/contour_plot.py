"""Plot of the largest contour of one side of a part, with the points that are cut inside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from matplotlib.axes import Axes

from robotrue.core.arrays import Array
from robotrue.core.columns import Column
from robotrue.core.units import MM
from robotrue.report.content import Plot
from robotrue.report.figure import AFTER, INK, Drawing
from robotrue.report.words import ReportTexts


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
