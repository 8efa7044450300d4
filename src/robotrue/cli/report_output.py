"""Reports written in the form their file name asks for, with their JSON twin beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robotrue.app.outputs import check_output
from robotrue.cli.console import say
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.errors import ConfigurationError
from robotrue.report.content import ReportContent

KINDS: Final = (".html", ".pdf", ".json")


def check_reports(outputs: Sequence[Path], sources: Sequence[Path]) -> None:
    """Refuses, before any work is done, outputs that cannot be.

    Raises:
        ConfigurationError: Another ending than ``.html``, ``.pdf``, ``.json``, or a file or folder
            :func:`check_output` refuses.
    """
    for output in outputs:
        if output.suffix.lower() not in KINDS:
            raise ConfigurationError(
                f"a report is {', '.join(KINDS)}, not {output.suffix or 'without an ending'!r}.",
                source=output,
                hint=f"-o {output.with_suffix('.html').name}",
            )
        check_output(output, sources)
        check_output(_twin(output), sources)


def write_reports(outputs: Sequence[Path], content: ReportContent) -> list[Path]:
    """Writes as :func:`put_reports`, and says so; returns what was written."""
    made = put_reports(outputs, content)
    say(f"report written to {', '.join(str(path) for path in made)}")
    return made


def put_reports(outputs: Sequence[Path], content: ReportContent) -> list[Path]:
    """Writes the report to every output, and its JSON twin beside each; returns what was written.

    Raises:
        MissingExtraError: A PDF is asked for and typst is not installed.
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
        made[_twin(output)] = report_json(content).encode("utf-8")
    for path, data in made.items():
        write_atomic(path, data)
    return list(made)


def file_fact(path: Path) -> str:
    """Returns a file's name and SHA-256, as provenance prints them."""
    return f"{path.name} sha256:{sha256(read_bytes(path))}"


def _twin(output: Path) -> Path:
    return output.with_suffix(".json")
