"""The errors of regions point by point, one panel an axis (Figures 4 and 5 of Deng et al. 2022)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from matplotlib.axes import Axes

from robotrue.core.arrays import Array
from robotrue.core.columns import Column
from robotrue.core.units import MM
from robotrue.report.content import Plot, nullable
from robotrue.report.curve_plots import PEERS
from robotrue.report.figure import AFTER, Drawing
from robotrue.report.words import ReportTexts


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorCurves(Plot):
    """Plot of error components over the points of a reference region and of others.

    Attributes:
        names: Region of each curve, the reference first.
        errors: (regions, n, 3) m at corresponding points; NaN where a region has none.
    """

    names: Annotated[tuple[str, ...], Column("regions")]
    errors: Annotated[Array, Column("regions n 3", unit="m", nan=True)]
    title: str = "Errors of regions at corresponding points"
    kind: ClassVar[str] = "error-curves"
    json_keys: ClassVar[Mapping[str, str]] = {"regions": "names"}

    def _json_more(self) -> dict[str, object]:
        return {"errors_mm": nullable(self.errors / MM)}

    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns one panel for each axis, the number of the point to the right."""

        def draw(axes: list[Axes]) -> None:
            number = np.arange(1, self.errors.shape[1] + 1)
            for k, ax in enumerate(axes):
                for r, name in enumerate(self.names):
                    color, _, line = (AFTER, "", "-") if not r else PEERS[(r - 1) % len(PEERS)]
                    ax.plot(
                        number, self.errors[r, :, k] / MM, line, color=color, lw=1.2, label=name
                    )
                ax.set_title(f"{'xyz'[k]}, mm")
                ax.set_xlabel("point")
            axes[0].legend(fontsize=8)

        return Drawing(draw=draw, width=12.0, height=3.4, panels=3)
