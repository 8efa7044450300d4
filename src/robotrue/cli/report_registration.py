"""``robotrue report registration``: where the parts of a cell stand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_json
from robotrue.cli.report_output import check_reports, file_fact, write_reports
from robotrue.errors import ConfigurationError
from robotrue.report.calibration import fact
from robotrue.report.registration import registration_content
from robotrue.report.words import Words, language


def run(
    cell_path: Path, outputs: Sequence[Path], *, lang: str, simulated: bool, as_json: bool
) -> None:
    """Writes the report of a registered cell.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    check_reports(outputs, [cell_path])
    speech = language(lang)
    cell = read_cell(cell_path)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame.",
            source=cell_path,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    content = registration_content(
        cell.part,
        name=cell_path.name,
        robot=cell.robot.name,
        simulated=simulated,
        provenance=[fact(Words(lang=speech), "fact.cell", file_fact(cell_path))],
        lang=speech,
    )
    written = write_reports(outputs, content)
    if as_json:
        emit_json(
            {
                "written": [str(path) for path in written],
                "verdict": "GO" if content.verdict.tone == "good" else "NO-GO",
                "text": content.verdict.text,
            }
        )
