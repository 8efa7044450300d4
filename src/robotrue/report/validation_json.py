"""A validation as JSON values: the keys ``robotrue validate --json`` promises."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotrue.core.units import DEG, MM
from robotrue.validation.metrics import ErrorStatistics
from robotrue.validation.validate import AxisAngles, ValidationReport


def validation_document(report: ValidationReport) -> Mapping[str, Any]:
    """Returns the numbers of a validation; lengths in mm, shares 0 to 1, units in the names.

    ``n, mean_mm, max_mm, p95_mm, std_mm, coverage_95`` and ``before`` are a contract; more keys
    may be added, none taken away.
    """
    inside = report.coverage
    return {
        **_statistics(report.after),
        "coverage_95": inside.share,
        "coverage_95_low": inside.low,
        "coverage_95_high": inside.high,
        "coverage_95_axis": inside.axis_share.tolist(),
        "before": _statistics(report.before),
        "before_aligned": _maybe(report.before_aligned),
        "tool_axis_before": _angles(report.axis_before),
        "tool_axis_after": _angles(report.axis_after),
        "floor_mm": report.floor / MM,
        "outside_training_region": len(report.outside),
        "worst": [
            {
                "set": point.group,
                "source_row": point.source_row,
                "joints_deg": (point.joints / DEG).tolist(),
                "position_mm": (point.position / MM).tolist(),
                "before_mm": point.before / MM,
                "after_mm": (point.after / MM).tolist(),
                "probability": point.probability,
            }
            for point in report.worst
        ],
        "doubts": list(report.doubts),
        "notes": list(report.notes),
    }


def _statistics(statistics: ErrorStatistics) -> dict[str, Any]:
    return {
        "n": statistics.n,
        "mean_mm": statistics.mean / MM,
        "max_mm": statistics.max / MM,
        "p95_mm": statistics.p95 / MM,
        "std_mm": statistics.std / MM,
        "rms_mm": statistics.rms / MM,
        "three_sigma_mm": statistics.three_sigma / MM,
        "axis_mean_mm": (statistics.axis_mean / MM).tolist(),
        "axis_std_mm": (statistics.axis_std / MM).tolist(),
        "axis_max_mm": (statistics.axis_max / MM).tolist(),
    }


def _maybe(statistics: ErrorStatistics | None) -> dict[str, Any] | None:
    return None if statistics is None else _statistics(statistics)


def _angles(angles: AxisAngles | None) -> dict[str, Any] | None:
    if angles is None:
        return None
    return {
        "n": angles.n,
        "mean_deg": angles.mean / DEG,
        "p95_deg": angles.p95 / DEG,
        "max_deg": angles.max / DEG,
    }
