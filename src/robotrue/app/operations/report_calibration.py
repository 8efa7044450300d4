"""Write the calibration certificate of a model, best with poses it has not seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from robotrue.app import reported
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import WrittenFiles
from robotrue.app.request import InputFile, Item, Option, Output, Reference, Request
from robotrue.app.request_fields import CalibratedModel, CertificateDetails, Columns
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.report.words import Lang


class ReportCalibrationRequest(Request):
    """Which model to certify, by which poses, with what else that counts in the budget."""

    model: CalibratedModel
    test: Annotated[
        tuple[Reference, ...],
        Item(noun="measurement", argument="[TEST...]", help="Poses the calibration has not seen."),
    ] = ()
    output: Annotated[
        tuple[Path, ...],
        Output(
            names=("--output", "-o"),
            help=".html, .pdf, .json or .xml (DCC); may be repeated. JSON is always written, too.",
        ),
    ]
    lang: reported.Language = DEFAULT_LANG
    tolerance_mm: Annotated[
        float | None,
        Field(gt=0.0),
        Option(help="Say whether 95 % of the held-out poses keep it."),
    ] = None
    cell: Annotated[
        Reference | None, Item(noun="registration", help="Registered cell whose part counts.")
    ] = None
    part: Annotated[str | None, Option(help="Part frame of --cell.")] = None
    force_sigma_N: Annotated[
        float,
        Field(ge=0.0),
        Option(
            names=("--force-sigma-n",),
            help="Standard deviation of the process force, per axis, for the budget.",
        ),
    ] = 0.0
    details: Annotated[
        Path | None,
        InputFile(help="TOML with a [report] table: number, customer, serial numbers, ..."),
    ] = None
    detail: CertificateDetails = ()
    mapping: Columns = None
    simulated: reported.Simulated = False


def run(request: ReportCalibrationRequest, context: Context) -> WrittenFiles:
    """Writes the certificate."""
    lang = reported.check_report_request(request, request.output, request.lang, certificate=True)
    return reported.write_draft(draft_certificate(request, context, lang), request.output, context)


def draft_certificate(
    request: ReportCalibrationRequest, context: Context, lang: Lang
) -> reported.ReportDraft:
    """Returns the certificate before it is written.

    Raises:
        ObservabilityError: No poses, and a model that keeps no joint range.
    """
    from robotrue.app.registered import open_model
    from robotrue.report.certificate import certificate_content
    from robotrue.report.certificate_facts import certificate_facts, origin_of
    from robotrue.report.certificate_head import read_certificate_head
    from robotrue.report.dcc import dcc_xml

    head = read_certificate_head(request.details, request.detail)
    model, path = context.model(request.model).model, context.model_file(request.model)
    place = None if request.cell is None else context.registration_file(request.cell)
    cell, _ = open_model(path, place)
    check = context.measurements(cell, request.test, request.mapping) if request.test else None
    context.step("judging", 1, 4)
    tests = [each for each in request.test if isinstance(each, Path)]
    facts = replace(
        certificate_facts(
            model,
            cell,
            check,
            part=request.part,
            force_sigma=request.force_sigma_N,
            simulated=request.simulated,
            files=[("fact.model", path), *(("fact.test", each) for each in tests)],
            lang=lang,
        ),
        head=head,
    )
    tolerance = None if request.tolerance_mm is None else request.tolerance_mm * MM
    content, budget = certificate_content(facts, tolerance=tolerance, lang=lang), facts.budget
    return reported.ReportDraft(
        content=content,
        numbers={
            "verdict": content.verdict.text,
            "expanded_uncertainty_mm": budget.expanded / MM,
            "expanded_uncertainty_worst_mm": budget.worst / MM,
            "contributions_mm": {c.name: c.standard_uncertainty / MM for c in budget.contributions},
            "check": None if facts.check is None else facts.check.to_json(),
        },
        provenance=replace(origin_of(model, check), simulated=facts.simulated),
        xml=lambda: dcc_xml(facts, tolerance=tolerance, lang=lang),
    )


OPERATION: Final = Operation(request=ReportCalibrationRequest, run=run)
