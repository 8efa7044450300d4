"""The same report for programs: every number of the page, units in the names."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import sha256
from robotrue.core.units import DEG, MM
from robotrue.report.budget_plot import BudgetPlot
from robotrue.report.content import (
    Block,
    Cell,
    Column,
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    Fact,
    HoleContour,
    MapSlices,
    PointErrors,
    PoseCurves,
    ReportContent,
    Table,
)
from robotrue.report.part_map import PartMap
from robotrue.report.tilt_plot import TiltPlot
from robotrue.report.uncertainty_map import UncertaintyMap

HASH: Final = "content_sha256"


def report_json(content: ReportContent) -> str:
    """Returns the report as JSON text; equal content gives equal text, NaN becomes null.

    ``content_sha256`` in it is the hash of all the rest (:func:`is_intact`), inputs included:
    ``provenance`` holds theirs.
    """
    document = report_document(content)
    signed = {**document, HASH: document_sha256(document)}
    return json.dumps(signed, indent=1, allow_nan=False, ensure_ascii=False)


def content_sha256(content: ReportContent) -> str:
    """Returns the hash page, print and JSON of a report carry."""
    return document_sha256(report_document(content))


def document_sha256(document: Mapping[str, Any]) -> str:
    """Returns the SHA-256 of the canonical JSON: keys sorted, no blanks, UTF-8, no hash in it."""
    bare = {key: value for key, value in document.items() if key != HASH}
    text = json.dumps(
        bare, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False
    )
    return sha256(text.encode("utf-8"))


def is_intact(document: Mapping[str, Any]) -> bool:
    """Returns whether a JSON report still is what its hash was made of."""
    return document.get(HASH) == document_sha256(document)


def report_document(content: ReportContent) -> Mapping[str, Any]:
    """Returns the report as JSON values without its hash; lengths in mm, angles in deg."""
    return {
        "format": "robotrue-report",
        "format_version": 1,
        "lang": content.lang,
        "title": content.title,
        "subtitle": content.subtitle,
        "simulated": content.simulated,
        "verdict": {
            "tone": content.verdict.tone,
            "text": content.verdict.text,
            "detail": content.verdict.detail,
        },
        "tiles": [
            {
                "label": tile.key or tile.label,
                "value": _finite(tile.value),
                "unit": tile.unit,
                "before": _finite(tile.before),
                "note": tile.note,
            }
            for tile in content.tiles
        ],
        "sections": [
            {
                "title": section.title,
                "text": section.text,
                "blocks": [_block(block) for block in section.blocks],
            }
            for section in content.sections
        ],
        "unseen": list(content.unseen),
        "doubts": list(content.doubts),
        "provenance": _facts(content.provenance),
    }


def _facts(facts: tuple[Fact, ...]) -> Mapping[str, Any]:
    """Values by name; several of one name as a list."""
    found: dict[str, list[str]] = {}
    for fact in facts:
        found.setdefault(fact.key or fact.name, []).append(fact.value)
    return {name: v[0] if len(v) == 1 else v for name, v in found.items()}


def _block(block: Block) -> Mapping[str, Any]:
    head: dict[str, Any] = {"title": block.title, "caption": block.caption}
    match block:
        case Table():
            names = [_column_name(column) for column in block.columns]
            rows = [dict(zip(names, map(_cell, row), strict=True)) for row in block.rows]
            return head | {"kind": "table", "rows": rows, "highlight": block.highlight}
        case PointErrors():
            return head | {
                "kind": "point-errors",
                "before_mm": _mm(block.before),
                "after_mm": _mm(block.after),
                "limit_mm": None if block.limit is None else block.limit / MM,
            }
        case ErrorDistribution():
            return head | {
                "kind": "distribution",
                "before_mm": _mm(block.before),
                "after_mm": _mm(block.after),
            }
        case ErrorMap():
            return head | {
                "kind": "map",
                "plane": block.plane,
                "position_mm": _mm(block.position),
                "before_mm": _mm(block.before),
                "after_mm": _mm(block.after),
            }
        case CoveragePlot():
            return head | {
                "kind": "coverage",
                "stated": block.stated.tolist(),
                "observed": block.observed.tolist(),
                "low": block.low.tolist(),
                "high": block.high.tolist(),
            }
        case HoleContour():
            return head | {
                "kind": "hole-contour",
                "radius_mm": block.radius / MM,
                "angle_deg": np.round(block.angle / DEG, 6).tolist(),
                "before_mm": _mm(block.before),
                "after_mm": _mm(block.after),
                "limit_mm": None if block.limit is None else block.limit / MM,
            }
        case PoseCurves():
            return head | {
                "kind": "pose-curves",
                "floor_mm": None if block.floor is None else block.floor / MM,
                "series": [
                    {
                        "label": s.label,
                        "role": s.role,
                        "count": s.count.tolist(),
                        "median_mm": _nullable(s.median / MM),
                        "low_mm": _nullable(s.low / MM),
                        "high_mm": _nullable(s.high / MM),
                        "coverage_95": _nullable(s.coverage),
                    }
                    for s in block.series
                ],
            }
        case TiltPlot():
            return head | {
                "kind": "tilt",
                "before_deg": np.round(block.before / DEG, 6).tolist(),
                "after_deg": np.round(block.after / DEG, 6).tolist(),
                "force_N": block.force.tolist(),
                "tilt_deg": np.round(block.tilt / DEG, 6).tolist(),
                "limit_deg": None if block.limit is None else block.limit / DEG,
            }
        case PartMap():
            return head | {
                "kind": "part_map",
                "groups": list(block.groups),
                "group": [int(k) for k in block.group],
                "point_mm": (block.point / MM).tolist(),
                "radius_95_mm": (block.radius / MM).tolist(),
                "touch_mm": (block.touch / MM).tolist(),
                "uncovered": list(block.uncovered),
            }
        case BudgetPlot():
            return head | {
                "kind": "budget",
                "names": list(block.names),
                "standard_uncertainty_mm": _mm(block.value),
                "combined_mm": block.combined / MM,
            }
        case UncertaintyMap():
            return head | {
                "kind": "uncertainty-map",
                "position_mm": _mm(block.position),
                "radius_95_mm": _mm(block.radius),
            }
        case MapSlices():
            return head | {
                "kind": "map-slices",
                "quantities": list(block.quantities),
                "slices": list(block.slices),
                block.across_label: block.across.tolist(),
                block.up_label: block.up.tolist(),
                "values_mm": _nullable(block.values / MM),
            }


def _nullable(values: Array) -> Any:
    """Nested lists with null where a value does not exist."""
    if values.ndim > 1:
        return [_nullable(part) for part in values]
    return [_finite(round(float(value), 7)) for value in values]


def _column_name(column: Column) -> str:
    return f"{column.key or column.title} {column.unit}".strip().replace(" ", "_")


def _mm(values: Array) -> Any:
    # A tenth of a nanometre: below any instrument, and the file stays readable.
    return np.round(values / MM, 7).tolist()


def _cell(value: Cell) -> Cell:
    return _finite(value) if isinstance(value, float) else value


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value
