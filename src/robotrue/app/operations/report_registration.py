"""Write where the parts of a registered cell stand, and how well that is known."""

from __future__ import annotations

from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.reported import (
    Language,
    Outputs,
    Reported,
    Simulated,
    check_report_request,
    report,
)
from robotrue.app.request import Item, Reference, Request
from robotrue.core.provenance import Provenance


class ReportRegistrationRequest(Request):
    """Which registered cell to report."""

    cell: Annotated[
        Reference,
        Item(noun="registration", argument="CELL", help="Cell that `register` wrote."),
    ]
    output: Outputs
    lang: Language = "en"
    simulated: Simulated = False


def run(request: ReportRegistrationRequest, context: Context) -> Reported:
    """Writes the report of a registered cell.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    from robotrue.app.report_contents import registration_report, verdict_word

    lang = check_report_request(request, request.output, request.lang)
    path = context.registration_file(request.cell)
    content = registration_report(path, lang=lang, simulated=request.simulated)
    numbers = {"verdict": verdict_word(content), "text": content.verdict.text}
    origin = Provenance(simulated=content.simulated)
    return report(content, request.output, numbers, origin, context)


OPERATION: Final = Operation(request=ReportRegistrationRequest, run=run)
