"""Report pages written by commands."""

from __future__ import annotations

from pathlib import Path

from robotrue.calibration.model import ErrorModel
from robotrue.core.files import write_atomic
from robotrue.report.calibration import calibration_content
from robotrue.report.content import Fact
from robotrue.report.page import report_html
from robotrue.validation.contest import Selection
from robotrue.validation.report import ValidationReport


def write_page(
    path: Path,
    model: ErrorModel,
    result: ValidationReport,
    *,
    title: str,
    selection: Selection | None = None,
) -> None:
    """Writes one validation as a self-contained HTML page.

    Raises:
        FormatError: The file cannot be written.
    """
    summary = model.training_summary()
    sources = [str(source) for source in summary.get("sources", ())]
    content = calibration_content(
        result,
        title=title,
        simulated=any("simulated" in source.lower() for source in sources),
        subtitle=f"{result.robot}, method {summary.get('method', 'unknown')}",
        selection=selection,
        unseen=[f"{d['name']}: {d['cure']}" for d in summary.get("unseen", ()) if d.get("cure")],
        provenance=[
            Fact(name="training data", value=str(summary.get("data_sha256", "not recorded"))),
            *(Fact(name="measured", value=source) for source in sources),
        ],
    )
    write_atomic(path, report_html(content).encode("utf-8"))
