"""Report pages written by commands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, merge
from robotrue.report.calibration_report import calibration_content
from robotrue.report.content import Fact
from robotrue.report.page import report_html
from robotrue.report.warning_groups import group_unseen, without_unseen
from robotrue.validation.contest import Selection
from robotrue.validation.report import ValidationReport


def write_page(
    path: Path,
    model: ErrorModel,
    result: ValidationReport,
    *,
    title: str,
    measured: Provenance,
    selection: Selection | None = None,
) -> None:
    """Writes one validation as a self-contained HTML page.

    Args:
        path: To be written.
        model: That was checked.
        result: Of the check.
        title: Heading.
        measured: Provenance of the poses it was checked on.
        selection: Why this method, if it was chosen automatically.

    Raises:
        FormatError: The file cannot be written.
    """
    summary = model.training_summary()
    sources = summary.sources
    origin = merge([provenance_of(model), measured])
    content = calibration_content(
        replace(result, doubts=without_unseen(model, result.doubts)),
        title=title,
        simulated=origin.simulated,
        subtitle=f"{result.robot}, method {summary.method or 'unknown'}",
        selection=selection,
        unseen=group_unseen(model),
        provenance=[
            Fact(name="training data", value=summary.data_sha256 or "not recorded"),
            *(Fact(name="measured", value=source) for source in sources),
        ],
    )
    write_atomic(path, report_html(content).encode("utf-8"))
