"""Writes reports in the format of their suffix, with a JSON file next to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.report.content import ReportContent

SUFFIXES: Final = (".html", ".pdf", ".json")
XML: Final = ".xml"
"""Of a certificate, too: the Digital Calibration Certificate."""


def write_reports(
    outputs: Sequence[Path], content: ReportContent, xml: Callable[[], bytes] | None = None
) -> list[Path]:
    """Writes the report to every output, and its JSON file next to each; returns the written files.

    Args:
        outputs: Files; the suffix sets the format.
        content: Of the report.
        xml: Makes the content of ``.xml``; only certificates have one.

    Raises:
        MissingExtraError: A PDF is requested and typst is not installed.
        ConfigurationError: A PDF in Chinese, and no font for it.
        FormatError: A file cannot be written.
    """
    from robotrue.report.json import report_json
    from robotrue.report.page import report_html

    made = {}
    for output in outputs:
        kind = output.suffix.lower()
        if kind == ".html":
            made[output] = report_html(content).encode("utf-8")
        elif kind == ".pdf":
            from robotrue.report.pdf import report_pdf

            made[output] = report_pdf(content)
        elif kind == XML and xml is not None:
            made[output] = xml()
        made[json_twin(output)] = report_json(content).encode("utf-8")
    for path, data in made.items():
        write_atomic(path, data)
    return list(made)


def json_twin(output: Path) -> Path:
    """Returns where the JSON twin of a report is written."""
    return output.with_suffix(".json")


def file_fact(path: Path) -> str:
    """Returns a file's name and SHA-256, as provenance prints them."""
    return f"{path.name} sha256:{sha256(read_bytes(path))}"
