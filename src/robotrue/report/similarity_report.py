"""Similarities of regions as CSV and as a page, the error curves of the regions below them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from matplotlib.axes import Axes

from robotrue.calibration.deng2022.readings import SIMILARITY_READINGS, SimilarityReading
from robotrue.core.arrays import Array
from robotrue.core.columns import Column
from robotrue.core.csv_text import csv_text
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.regions import describe_region
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.report.content import (
    Cell,
    Conclusion,
    Fact,
    KeyFigure,
    Plot,
    ReportContent,
    ReportTable,
    Section,
    finite_or_none,
    nullable,
)
from robotrue.report.curve_plots import PEERS
from robotrue.report.figure import AFTER, Drawing
from robotrue.report.labels import plain_columns
from robotrue.report.words import ReportTexts
from robotrue.validation.region_similarity import NamedRegion, RegionSimilarity

_KINDS = {"cylinder": "Cylinder sectors", "cube": "Boxes"}


def similarities_csv(found: Sequence[RegionSimilarity], origin: Provenance) -> str:
    """Returns one row a region: kind, names, points, furthest pair in mm, a column a reading."""
    head = ["kind", "reference", "region", "points", "furthest_pair_mm", *SIMILARITY_READINGS]
    rows = [
        [
            each.kind,
            each.reference,
            each.name,
            len(each.rows),
            f"{each.apart.max() / MM:.4f}",
            *(
                "" if np.isnan(each.values[r]) else f"{each.values[r]:.6f}"
                for r in SIMILARITY_READINGS
            ),
        ]
        for each in found
    ]
    return mark_line(origin) + csv_text([head, *rows])


def curves_csv(
    found: Sequence[RegionSimilarity], rows: MeasurementSet, points: Array, errors: Array
) -> str:
    """Returns one row a region and point: error of the reference and of its counterpart, mm."""
    head = ["kind", "reference", "region", "point", "reference_line", "line"]
    for name in ("reference", "region"):
        head += [f"{name}_{axis}_mm" for axis in ("x", "y", "z", "ex", "ey", "ez")]
    lines = []
    for each in found:
        for k, (a, b) in enumerate(zip(each.reference_rows, each.rows, strict=True)):
            numbers = np.concatenate([points[a], errors[a], points[b], errors[b]]) / MM
            lines.append(
                [
                    each.kind,
                    each.reference,
                    each.name,
                    k + 1,
                    int(rows.source_row[a]),
                    int(rows.source_row[b]),
                    *(f"{value:.4f}" for value in numbers),
                ]
            )
    return mark_line(rows.provenance) + csv_text([head, *lines])


def similarity_content(
    found: Sequence[RegionSimilarity],
    errors: Array,
    regions: Sequence[NamedRegion],
    *,
    reading: SimilarityReading,
    wins: tuple[int, int] | None,
    poses: int,
    simulated: bool,
) -> ReportContent:
    """Returns the content of a page: similarities, and the curves of Figures 4 and 5.

    Args:
        found: Similarities, by kind.
        errors: (n, 3) m of all measured poses.
        regions: All that were compared.
        reading: Of the number in the conclusion.
        wins: In how many regions the cylinder is more alike than the cube, and of how many.
        poses: Measured.
        simulated: Whether they were simulated.
    """
    values = np.array([each.values[reading] for each in found])
    text = f"Similarity {np.nanmin(values):.4f} to {np.nanmax(values):.4f}, reading {reading}."
    if wins is not None:
        text += f" The cylinder is more similar than the cube in {wins[0]} of {wins[1]} regions."
    return ReportContent(
        title="Similarity of regions",
        subtitle=f"{poses} measured poses, {len(regions)} regions",
        simulated=simulated,
        verdict=Conclusion(text=text, detail="1: the errors are equal at corresponding points."),
        tiles=(
            KeyFigure(label="least similarity", value=float(np.nanmin(values)), digits=4),
            KeyFigure(label="largest", value=float(np.nanmax(values)), digits=4),
        ),
        sections=(
            Section(title="Similarity to the reference", blocks=(_table(found),)),
            *(_curves(kind, found, errors) for kind in dict.fromkeys(e.kind for e in found)),
        ),
        provenance=tuple(
            Fact(name=each.name, value=describe_region(each.region)) for each in regions
        ),
    )


def _table(found: Sequence[RegionSimilarity]) -> ReportTable:
    rows: list[tuple[Cell, ...]] = [
        (
            each.name,
            each.reference,
            len(each.rows),
            float(each.apart.max()) / MM,
            *(finite_or_none(each.values[r]) for r in SIMILARITY_READINGS),
        )
        for each in found
    ]
    return ReportTable(
        title="Eq. 9 and 10 of Deng et al. 2022 under each reading",
        columns=(
            *plain_columns("region", "reference", "points"),
            *plain_columns("furthest pair", unit="mm", digits=2),
            *plain_columns(*SIMILARITY_READINGS, digits=4),
        ),
        rows=tuple(rows),
    )


def _curves(kind: str, found: Sequence[RegionSimilarity], errors: Array) -> Section:
    alike = [each for each in found if each.kind == kind]
    shown = np.unique(np.concatenate([each.reference_rows for each in alike]))
    values = np.full((len(alike) + 1, len(shown), 3), np.nan)
    values[0] = errors[shown]
    for k, each in enumerate(alike):
        values[k + 1, np.searchsorted(shown, each.reference_rows)] = errors[each.rows]
    plot = ErrorCurves(
        names=(alike[0].reference, *(each.name for each in alike)),
        errors=values,
        title=f"{_KINDS[kind]}: errors at corresponding points",
        caption="Measured minus commanded, base axes; points in the order of the measurements.",
    )
    return Section(title=_KINDS[kind], blocks=(plot,))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorCurves(Plot):
    """Plot of error components over the points of regions (Figures 4 and 5 of Deng et al. 2022).

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
