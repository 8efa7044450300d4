"""Reports that commands write, and what they say of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app.reported import check_reports as check_reports
from robotrue.cli.console import say
from robotrue.report import report_files
from robotrue.report.content import ReportContent
from robotrue.report.report_files import file_fact as file_fact

put_reports = report_files.write_reports


def write_reports(outputs: Sequence[Path], content: ReportContent) -> list[Path]:
    """Writes the report to every output and its JSON twin, and says so; returns what it wrote."""
    made = put_reports(outputs, content)
    say(f"report written to {', '.join(str(path) for path in made)}")
    return made
