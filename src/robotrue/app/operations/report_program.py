"""Judge a compensated program against a tolerance: GO or NO-GO, and the worst targets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import reported
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import WrittenFiles
from robotrue.app.request import InputFile, Item, Option, Reference, Request
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.report.words import Lang


class ReportProgramRequest(Request):
    """Which program to judge, by which model and tolerance, under which force."""

    before: Annotated[
        Reference, Item(noun="program", argument="BEFORE", help="Program as CAM made it.")
    ]
    after: Annotated[Reference, Item(noun="program", argument="AFTER", help="The compensated one.")]
    model: Annotated[
        Reference,
        Item(noun="model", also=("registration",), help="Model file, or a registered cell."),
    ]
    tolerance_mm: Annotated[
        float, Option(help="Largest distance of a target from where it should be.")
    ]
    output: reported.Outputs
    lang: reported.Language = DEFAULT_LANG
    cell: Annotated[
        Reference | None, Item(noun="registration", help="Registered cell whose part counts.")
    ] = None
    wrench: Annotated[
        str | None, Option(help="Process force FX,FY,FZ[,MX,MY,MZ] in N, N m, base axes.")
    ] = None
    force: Annotated[Path | None, InputFile(help="Process force along the path.")] = None
    cutter: Annotated[
        str | None, Option(help="Axis of [tool] from spindle to tip, for --force.")
    ] = None
    start: Annotated[
        str | None, Option(help="Start posture A1,..,A6 in deg, as compensate takes it.")
    ] = None
    strict: Annotated[bool, Option(help="Axis targets count as targets that are not proven.")] = (
        False
    )
    simulated: reported.Simulated = False


def run(request: ReportProgramRequest, context: Context) -> WrittenFiles:
    """Writes the report; the verdict is in it, and never an error."""
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
        context: Where they are.
        lang: Language of the report.
        registered: Cell whose frames the program uses.

    Raises:
        ConfigurationError: The nominal arm, or a tolerance that is not above zero.
        ModelMismatchError: Programs that do not belong together, or no target to judge.
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
    context.step("judging", 1, 4)
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


OPERATION: Final = Operation(request=ReportProgramRequest, run=run)
