"""Result of both demos: their files, numbers and page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.report.content import ReportContent, ReportTable
from robotrue.report.json import report_json
from robotrue.report.page import report_html
from robotrue.validation.contest import Selection
from robotrue.validation.hole_contour import HoleResult
from robotrue.validation.metrics import ErrorStatistics, error_statistics


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoResult:
    """Files and numbers of a demo.

    Attributes:
        folder: Where the files are.
        page: The HTML page.
        results: JSON values, units in the names.
        tables: What the command prints.
        simulated: True for the virtual cell.
    """

    folder: Path
    page: Path
    results: Mapping[str, object]
    tables: tuple[ReportTable, ...]
    simulated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """A calibration and why it is this one."""

    model: ErrorModel
    selection: Selection


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleRuns:
    """Errors at the check targets (m, 3) m and the milled holes, before and after."""

    dry_before: Array
    dry_after: Array
    hole_before: HoleResult
    hole_after: HoleResult


def write_report(folder: Path, content: ReportContent, results: Mapping[str, object]) -> Path:
    """Writes ``demo.html``, ``report.json`` and ``results.json``; returns the page's path."""
    page = folder / "demo.html"
    write_atomic(page, report_html(content).encode())
    write_atomic(folder / "report.json", report_json(content).encode())
    write_atomic(folder / "results.json", json.dumps(dict(results), indent=1).encode())
    return page


def statistics_mm(s: ErrorStatistics) -> dict[str, float | int]:
    """Returns the JSON values of error statistics."""
    return {
        "n": s.n,
        "mean_mm": s.mean / MM,
        "p95_mm": s.p95 / MM,
        "max_mm": s.max / MM,
        "std_mm": s.std / MM,
    }


def lengths_mm(errors: Array) -> dict[str, float | int]:
    """Returns the JSON values of error vectors (n, 3) m."""
    return statistics_mm(error_statistics(errors))
