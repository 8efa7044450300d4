"""Signatures of ``robotrue report ...``: what a customer is handed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.cli.app import Json, ModelFile, app

report = typer.Typer(
    name="report",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Write a report to hand over: HTML, PDF and JSON, in English or Chinese.",
)
app.add_typer(report)

Outputs = Annotated[
    list[Path],
    typer.Option(
        "--output", "-o", help=".html, .pdf or .json; may be repeated. JSON is always written, too."
    ),
]
Language = Annotated[str, typer.Option("--lang", help="en or zh.")]
Simulated = Annotated[
    bool, typer.Option("--simulated", help="Say in the report that the data are simulated.")
]
Registered = Annotated[
    Path | None, typer.Option("--cell", help="Registered cell whose part counts.")
]


@report.command()
def calibration(
    model: ModelFile,
    test: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[TEST...]", help="Poses the calibration has not seen."),
    ] = None,
    output: Outputs = ...,  # type: ignore[assignment]
    lang: Language = "en",
    tolerance_mm: Annotated[
        float | None, typer.Option(help="Say whether 95 % of the held-out poses keep it.")
    ] = None,
    cell: Registered = None,
    part: Annotated[str | None, typer.Option(help="Part frame of --cell.")] = None,
    force_sigma_n: Annotated[
        float,
        typer.Option(help="Standard deviation of the process force, per axis, for the budget."),
    ] = 0.0,
    mapping: Annotated[Path | None, typer.Option(help="Column mapping (TOML).")] = None,
    simulated: Simulated = False,
    json: Json = False,
) -> None:
    """Write the calibration certificate of a model, best with poses it has not seen."""
    from robotrue.cli.report_calibration import run

    run(
        model,
        test or [],
        output,
        lang=lang,
        tolerance_mm=tolerance_mm,
        registered=cell,
        part=part,
        force_sigma_N=force_sigma_n,
        mapping=mapping,
        simulated=simulated,
        as_json=json,
    )


@report.command()
def program(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="Program as CAM made it.")],
    after: Annotated[Path, typer.Argument(metavar="AFTER", help="The compensated one.")],
    model: Annotated[Path, typer.Option(help="Model file, or a registered cell.")] = ...,  # type: ignore[assignment]
    tolerance_mm: Annotated[
        float, typer.Option(help="Largest distance of a target from where it should be.")
    ] = ...,  # type: ignore[assignment]
    output: Outputs = ...,  # type: ignore[assignment]
    lang: Language = "en",
    cell: Registered = None,
    wrench: Annotated[
        str | None, typer.Option(help="Process force FX,FY,FZ[,MX,MY,MZ] in N, N m, base axes.")
    ] = None,
    force: Annotated[Path | None, typer.Option(help="Process force along the path.")] = None,
    cutter: Annotated[
        str | None, typer.Option(help="Axis of [tool] from spindle to tip, for --force.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(help="Start posture A1,..,A6 in deg, as compensate takes it.")
    ] = None,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Axis targets count as targets that are not proven."),
    ] = False,
    simulated: Simulated = False,
    json: Json = False,
) -> None:
    """Judge a compensated program against a tolerance: GO or NO-GO, and the worst targets."""
    from robotrue.cli.report_program import run

    run(
        before,
        after,
        model,
        output,
        tolerance_mm=tolerance_mm,
        lang=lang,
        registered=cell,
        wrench=wrench,
        force=force,
        cutter=cutter,
        start=start,
        strict=strict,
        simulated=simulated,
        as_json=json,
    )


@report.command()
def registration(
    cell: Annotated[Path, typer.Argument(metavar="CELL", help="Cell that `register` wrote.")],
    output: Outputs = ...,  # type: ignore[assignment]
    lang: Language = "en",
    simulated: Simulated = False,
    json: Json = False,
) -> None:
    """Write where the parts of a registered cell stand, and how well that is known."""
    from robotrue.cli.report_registration import run

    run(cell, output, lang=lang, simulated=simulated, as_json=json)
