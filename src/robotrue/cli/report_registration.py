"""``robotrue report registration``: where the parts of a cell stand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_json, say_mark
from robotrue.cli.report_output import check_reports, file_fact, write_reports
from robotrue.cli.report_program import verdict_word
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError
from robotrue.report.calibration_report import fact
from robotrue.report.content import ReportContent
from robotrue.report.registration_report import registration_content
from robotrue.report.words import Lang, Words, language


def run(
    cell_path: Path, outputs: Sequence[Path], *, lang: str, simulated: bool, as_json: bool
) -> None:
    """Writes the report of a registered cell.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    check_reports(outputs, [cell_path])
    content = registration_report(cell_path, lang=language(lang), simulated=simulated)
    origin = Provenance(simulated=content.simulated)
    say_mark(origin)
    written = write_reports(outputs, content)
    if as_json:
        emit_json(
            {
                "written": [str(path) for path in written],
                "verdict": verdict_word(content),
                "text": content.verdict.text,
            },
            origin,
        )


def registration_report(
    cell_path: Path, *, lang: Lang, simulated: bool, name: str | None = None
) -> ReportContent:
    """Returns the content of the report of a registered cell.

    Args:
        cell_path: What ``robotrue register`` wrote.
        lang: Language of the report.
        simulated: Whether the data are; also taken from the provenance of the part frame.
        name: Of the registration in the report; None: that of the file.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    cell = read_cell(cell_path)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame.",
            source=cell_path,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    return registration_content(
        cell.part,
        name=name or cell_path.name,
        robot=cell.robot.name,
        simulated=simulated or cell.part.provenance.simulated,
        provenance=[fact(Words(lang=lang), "fact.cell", file_fact(cell_path))],
        lang=lang,
    )
