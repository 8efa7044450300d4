"""What each kind of block is in JSON and how it is drawn: one entry a kind, for page and print."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.report.budget_plot import BudgetPlot, budget_svg
from robotrue.report.content import (
    Block,
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    HoleContour,
    MapSlices,
    PointErrors,
    PoseCurves,
    Table,
    TableColumn,
)
from robotrue.report.map_figure import slices_svg
from robotrue.report.part_map import PartMap, part_map_svg
from robotrue.report.plots import (
    coverage_svg,
    distribution_svg,
    hole_svg,
    map_svg,
    point_errors_svg,
)
from robotrue.report.tilt_plot import TiltPlot, tilt_svg
from robotrue.report.transfer_curve import pose_curves_svg
from robotrue.report.uncertainty_map import UncertaintyMap, uncertainty_svg
from robotrue.report.words import Words

_UNITS: Final = {"mm": (MM, 7), "deg": (DEG, 6)}
"""Unit and decimals of arrays by the end of their key: a tenth of a nanometre is below any
instrument, and the file stays readable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockKind:
    """One kind of block.

    Attributes:
        name: In JSON.
        draw: Returns the SVG of a block, the prefix of its ids and the words of its page.
        values: Attribute by key of the JSON; the end of a key is the unit it is written in.
        more: Returns what the keys do not say.
    """

    name: str
    draw: Callable[[Any, str, Words], str]
    values: Mapping[str, str] = field(default_factory=dict)
    more: Callable[[Any], Mapping[str, Any]] = lambda _: {}


def draw_block(block: Block, key: str, words: Words) -> str:
    """Returns the drawing of a block as an SVG element; empty for a table.

    Args:
        block: Of a section.
        key: Prefix of its ids.
        words: For what the drawing says itself.
    """
    return KINDS[type(block)].draw(block, key, words)


def block_document(block: Block) -> dict[str, Any]:
    """Returns a block as JSON values; lengths in mm, angles in deg."""
    kind = KINDS[type(block)]
    return {
        "title": block.title,
        "caption": block.caption,
        "kind": kind.name,
        **{key: _value(getattr(block, name), key) for key, name in kind.values.items()},
        **kind.more(block),
    }


def finite_or_none(value: float | None) -> float | None:
    """Returns the value, or None (null in JSON) where there is none or it is not finite."""
    return None if value is None or not math.isfinite(value) else value


def _value(value: Any, key: str) -> Any:
    unit, digits = _UNITS.get(key.rpartition("_")[2], (1.0, None))
    if isinstance(value, np.ndarray):
        return (value if digits is None else np.round(value / unit, digits)).tolist()
    if isinstance(value, tuple):
        return list(value)
    return value / unit if isinstance(value, float) else value


def _nullable(values: Array) -> Any:
    """Returns nested lists, rounded, with null where a value does not exist."""
    if values.ndim > 1:
        return [_nullable(part) for part in values]
    return [finite_or_none(round(float(value), 7)) for value in values]


def _table_rows(table: Table) -> dict[str, Any]:
    names = [_column_name(column) for column in table.columns]
    rows = [
        {
            name: finite_or_none(cell) if isinstance(cell, float) else cell
            for name, cell in zip(names, row, strict=True)
        }
        for row in table.rows
    ]
    return {"rows": rows, "highlight": table.highlight}


def _column_name(column: TableColumn) -> str:
    return f"{column.key or column.title} {column.unit}".strip().replace(" ", "_")


def _pose_series(curves: PoseCurves) -> dict[str, Any]:
    return {
        "series": [
            {
                "label": series.label,
                "role": series.role,
                "count": series.count.tolist(),
                "median_mm": _nullable(series.median / MM),
                "low_mm": _nullable(series.low / MM),
                "high_mm": _nullable(series.high / MM),
                "coverage_95": _nullable(series.coverage),
            }
            for series in curves.series
        ]
    }


def _slices(slices: MapSlices) -> dict[str, Any]:
    return {
        slices.across_label: slices.across.tolist(),
        slices.up_label: slices.up.tolist(),
        "values_mm": _nullable(slices.values / MM),
    }


def _part_points(part: PartMap) -> dict[str, Any]:  # not rounded
    return {
        "group": [int(k) for k in part.group],
        "point_mm": (part.point / MM).tolist(),
        "radius_95_mm": (part.radius / MM).tolist(),
        "touch_mm": (part.touch / MM).tolist(),
        "uncovered": list(part.uncovered),
    }


_BEFORE_AFTER: Final = {"before_mm": "before", "after_mm": "after"}
KINDS: Final[Mapping[type, BlockKind]] = {
    Table: BlockKind(name="table", draw=lambda *_: "", more=_table_rows),
    PointErrors: BlockKind(
        name="point-errors", draw=point_errors_svg, values=_BEFORE_AFTER | {"limit_mm": "limit"}
    ),
    ErrorDistribution: BlockKind(name="distribution", draw=distribution_svg, values=_BEFORE_AFTER),
    ErrorMap: BlockKind(
        name="map",
        draw=map_svg,
        values={"plane": "plane", "position_mm": "position"} | _BEFORE_AFTER,
    ),
    CoveragePlot: BlockKind(
        name="coverage",
        draw=coverage_svg,
        values={name: name for name in ("stated", "observed", "low", "high")},
    ),
    HoleContour: BlockKind(
        name="hole-contour",
        draw=hole_svg,
        values={"radius_mm": "radius", "angle_deg": "angle"}
        | _BEFORE_AFTER
        | {"limit_mm": "limit"},
    ),
    PoseCurves: BlockKind(
        name="pose-curves",
        draw=lambda block, key, _: pose_curves_svg(block, key),
        values={"floor_mm": "floor"},
        more=_pose_series,
    ),
    TiltPlot: BlockKind(
        name="tilt",
        draw=tilt_svg,
        values={
            "before_deg": "before",
            "after_deg": "after",
            "force_N": "force",
            "tilt_deg": "tilt",
            "limit_deg": "limit",
        },
    ),
    PartMap: BlockKind(
        name="part_map",
        draw=lambda block, key, _: part_map_svg(block, key),
        values={"groups": "groups"},
        more=_part_points,
    ),
    BudgetPlot: BlockKind(
        name="budget",
        draw=budget_svg,
        values={"names": "names", "standard_uncertainty_mm": "value", "combined_mm": "combined"},
    ),
    UncertaintyMap: BlockKind(
        name="uncertainty-map",
        draw=uncertainty_svg,
        values={"position_mm": "position", "radius_95_mm": "radius"},
    ),
    MapSlices: BlockKind(
        name="map-slices",
        draw=lambda block, key, _: slices_svg(block, key),
        values={"quantities": "quantities", "slices": "slices"},
        more=_slices,
    ),
}
"""Every kind of block; a new one is a class in ``content`` and an entry here."""
