"""Judge a compensated program against a tolerance: GO or NO-GO, and the worst targets."""

from __future__ import annotations

from pathlib import Path
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
from robotrue.app.request import InputFile, Item, Option, Reference, Request
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM


class ReportProgramRequest(Request):
    """Which program to judge, by which model and tolerance, under which force."""

    before: Annotated[
        Reference, Item(noun="program", argument="BEFORE", help="Program as CAM made it.")
    ]
    after: Annotated[Reference, Item(noun="program", argument="AFTER", help="The compensated one.")]
    model: Annotated[Reference, Item(noun="model", help="Model file, or a registered cell.")]
    tolerance_mm: Annotated[
        float, Option(help="Largest distance of a target from where it should be.")
    ]
    output: Outputs
    lang: Language = "en"
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
    simulated: Simulated = False


def run(request: ReportProgramRequest, context: Context) -> Reported:
    """Writes the report; the verdict is in it, and never an error.

    Raises:
        ConfigurationError: The nominal arm, or a tolerance that is not above zero.
        ModelMismatchError: Programs that do not belong together, or no target to judge.
    """
    from robotrue.app.report_contents import program_report, verdict_word

    lang = check_report_request(request, request.output, request.lang)
    content = program_report(
        context.program_files([request.before])[0],
        context.program_files([request.after])[0],
        context.model_file(request.model),
        tolerance=request.tolerance_mm * MM,
        lang=lang,
        registered=None if request.cell is None else context.registration_file(request.cell),
        wrench=request.wrench,
        force=request.force,
        cutter=request.cutter,
        start=request.start,
        simulated=request.simulated,
        strict=request.strict,
    )
    numbers = {
        "verdict": verdict_word(content),
        "text": content.verdict.text,
        "tolerance_mm": request.tolerance_mm,
    }
    origin = Provenance(simulated=content.simulated)
    return report(content, request.output, numbers, origin, context)


OPERATION: Final = Operation(request=ReportProgramRequest, run=run)
