"""Write where the parts of a registered cell stand, and how well that is known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import reported
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import WrittenFiles
from robotrue.app.request import Item, Reference, Request
from robotrue.core.files import DEFAULT_LANG
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.report.words import Lang


class ReportRegistrationRequest(Request):
    """Which registered cell to report."""

    cell: Annotated[
        Reference,
        Item(noun="registration", argument="CELL", help="Cell that `register` wrote."),
    ]
    output: reported.Outputs
    lang: reported.Language = DEFAULT_LANG
    simulated: reported.Simulated = False


def run(request: ReportRegistrationRequest, context: Context) -> WrittenFiles:
    """Writes the report of a registered cell."""
    lang = reported.check_report_request(request, request.output, request.lang)
    return reported.write_draft(draft_registration(request, context, lang), request.output, context)


def draft_registration(
    request: ReportRegistrationRequest, context: Context, lang: Lang
) -> reported.ReportDraft:
    """Returns the report before it is written.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    from robotrue.cell.config import read_cell
    from robotrue.report.labels import fact
    from robotrue.report.registration_report import registration_content
    from robotrue.report.report_files import file_fact
    from robotrue.report.words import ReportTexts

    path = context.registration_file(request.cell)
    context.step("judging", 1, 4)
    cell = read_cell(path)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame.",
            source=path,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    content = registration_content(
        cell.part,
        name=path.name if isinstance(request.cell, Path) else context.name(request.cell),
        robot=cell.robot.name,
        simulated=request.simulated or cell.part.provenance.simulated,
        provenance=[fact(ReportTexts(lang=lang), "fact.cell", file_fact(path))],
        lang=lang,
    )
    return reported.draft_verdict(content)


OPERATION: Final = Operation(request=ReportRegistrationRequest, run=run)
