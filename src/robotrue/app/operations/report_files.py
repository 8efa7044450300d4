"""Reports of a model, a program or a registration, written as files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from robotrue.app import reported
from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import PlainResult
from robotrue.app.request import InputFile, Item, Option, Output, Reference, Request
from robotrue.app.request_fields import OUTPUT, CalibratedModel, CertificateDetails, Columns
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.report.words import Lang


class ReportCalibrationRequest(Request):
    """Model to certify, poses to check it on, and further terms of the budget."""

    model: CalibratedModel
    test: Annotated[tuple[Reference, ...], Item(noun="measurement", argument="[TEST...]")] = ()
    """Held-out poses."""
    output: Annotated[tuple[Path, ...], Output(names=OUTPUT)]
    """.html, .pdf, .json or .xml (DCC); may be repeated. JSON is always written, too."""
    lang: reported.Language = DEFAULT_LANG
    tolerance_mm: Annotated[float | None, Field(gt=0.0)] = None
    """Tolerance to check for 95 % of the held-out poses."""
    cell: Annotated[Reference | None, Item(noun="registration")] = None
    """Registered cell with the part frame."""
    part: str | None = None
    """Part frame of --cell."""
    force_sigma_N: Annotated[float, Field(ge=0.0), Option(names=("--force-sigma-n",))] = 0.0
    """Standard deviation of the process force, per axis, for the budget."""
    details: Annotated[Path | None, InputFile()] = None
    """TOML with a [report] table: number, customer, serial numbers, ..."""
    detail: CertificateDetails = ()
    mapping: Columns = None
    simulated: reported.Simulated = False


@operation("report_calibration")
def report_calibration(request: ReportCalibrationRequest, context: Context) -> PlainResult:
    """Write the calibration certificate of a model, preferably with held-out poses."""
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
    context.step("checking", 1, 4)
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


class ReportProgramRequest(Request):
    """Program to check, the model, the tolerance, and the force."""

    before: Annotated[Reference, Item(noun="program", argument="BEFORE")]
    """Program from CAM."""
    after: Annotated[Reference, Item(noun="program", argument="AFTER")]
    """Compensated program."""
    model: Annotated[Reference, Item(noun="model", also=("registration",))]
    """Model file, or a registered cell."""
    tolerance_mm: float
    """Tolerance on the position error of a target."""
    output: reported.Outputs
    lang: reported.Language = DEFAULT_LANG
    cell: Annotated[Reference | None, Item(noun="registration")] = None
    """Registered cell with the part frame."""
    wrench: str | None = None
    """Process force FX,FY,FZ[,MX,MY,MZ] in N, N m, base axes."""
    force: Annotated[Path | None, InputFile()] = None
    """Process force along the path."""
    cutter: str | None = None
    """Axis of [tool] from spindle to tip, for --force."""
    start: str | None = None
    """Start posture A1,..,A6 in deg, as for compensate."""
    strict: bool = False
    """Joint targets count as unproven."""
    simulated: reported.Simulated = False


@operation("report_program")
def report_program(request: ReportProgramRequest, context: Context) -> PlainResult:
    """Check a compensated program against a tolerance: GO or NO-GO, and the worst targets."""
    lang = reported.check_report_request(request, request.output, request.lang)
    place = None if request.cell is None else context.registration_file(request.cell)
    return reported.write_draft(
        draft_program(request, context, lang, place), request.output, context
    )


def draft_program(
    request: ReportProgramRequest, context: Context, lang: Lang, registered: Path | None
) -> reported.ReportDraft:
    """Returns the report before it is written.

    Args:
        request: The programs, the model and the tolerance.
        context: Source of the files.
        lang: Language of the report.
        registered: Cell whose frames the program uses.

    Raises:
        ConfigurationError: The nominal arm, or a tolerance that is not above zero.
        ModelMismatchError: Programs that do not belong together, or no target to check.
    """
    from robotrue.app.force_options import read_force_options
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.compensation.difference import compare_jobs
    from robotrue.compensation.stance import start_joints
    from robotrue.report.labels import fact
    from robotrue.report.program_report import program_content
    from robotrue.report.report_files import file_fact
    from robotrue.report.words import ReportTexts

    path = context.model_file(request.model)
    (before, *_) = context.program_files([request.before])
    (after, *_) = context.program_files([request.after], folder="after")
    context.step("checking", 1, 4)
    cell, model = open_model(path, registered)
    if model is None:
        raise ConfigurationError(
            "the nominal arm predicts no errors.",
            source=path,
            hint="--model MODEL, a file of `robotrue calibrate`.",
        )
    home = start_joints(cell.robot, cell.controller.start, request.start)
    pushed = read_force_options(cell, request.wrench, request.force, request.cutter)
    t = ReportTexts(lang=lang)
    read = [
        *(("fact.program", each) for job in (before, after) for each in _files_of(job)),
        ("fact.model", path),
        *(("fact.cell", each) for each in (registered,) if each is not None),
        *(("fact.force", each) for each in (request.force,) if each is not None),
    ]
    content = program_content(
        compare_jobs([before], [after], cell, model, pushed, home),
        robot=model.robot.name,
        before=before.name,
        after=after.name,
        tolerance=request.tolerance_mm * MM,
        simulated=request.simulated or provenance_used(cell, model).simulated,
        doubts=list(model.training_summary().warnings),
        provenance=[
            *(fact(t, key, file_fact(each)) for key, each in read),
            *(fact(t, "fact.force", each) for each in (request.wrench,) if each is not None),
        ],
        lang=lang,
        strict=request.strict,
    )
    return reported.draft_verdict(content, tolerance_mm=request.tolerance_mm)


def _files_of(job: Path) -> list[Path]:
    """The files of a job: those of its folder, or the one it is."""
    return sorted(p for p in job.iterdir() if p.is_file()) if job.is_dir() else [job]


class ReportRegistrationRequest(Request):
    """Registered cell to report."""

    cell: Annotated[Reference, Item(noun="registration", argument="CELL")]
    """Cell that `register` wrote."""
    output: reported.Outputs
    lang: reported.Language = DEFAULT_LANG
    simulated: reported.Simulated = False


@operation("report_registration")
def report_registration(request: ReportRegistrationRequest, context: Context) -> PlainResult:
    """Report the part frames of a registered cell with their uncertainty."""
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
    context.step("checking", 1, 4)
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
