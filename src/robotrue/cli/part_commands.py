"""Signature of the command that plans what to touch on the part."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, PAGE, PNG
from robotrue.cli.app import Json, app


@app.command(name="probe-plan")
def probe_plan(
    cell: Annotated[
        Path,
        typer.Argument(metavar="CELL|MODEL", help="cell.toml (nominal arm) or model file."),
    ],
    part: Annotated[Path, typer.Option("--part", help="CSV of the features that can be touched.")],
    machined: Annotated[
        list[Path],
        typer.Option(
            "--machined",
            help="Postures (CSV with joints), tool path or program; may be repeated.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="CSV of the touches to write.", callback=CSV)
    ],
    touches: Annotated[int, typer.Option("--touches", "-n", help="How many, at most.")] = 20,
    frame: Annotated[
        str | None,
        typer.Option(help="X,Y,Z,A,B,C: roughly where the part stands; default: what CELL says."),
    ] = None,
    run: Annotated[
        str, typer.Option(help="compensated, or unchanged: with the controller's own model.")
    ] = "compensated",
    goal: Annotated[
        str, typer.Option(help="mean: least rms uncertainty. worst: that of the worst point.")
    ] = "mean",
    tolerance_mm: Annotated[
        float, typer.Option(help="Stop when that uncertainty (3-D, one sigma) is below this.")
    ] = 0.0,
    touch_sigma_mm: Annotated[
        float, typer.Option(help="One standard deviation per axis of one touch.")
    ] = 0.1,
    tool_sigma_mm: Annotated[
        float | None,
        typer.Option(help="Of the tip in the flange; 0: unchanged since the model was made."),
    ] = None,
    lean_deg: Annotated[
        float, typer.Option(help="By which touches lean off the machined attitudes.")
    ] = 15.0,
    tip_axis: Annotated[
        str, typer.Option(help="The way to the tip in the tool frame: +z, or +x on many KUKA.")
    ] = "+z",
    report: Annotated[
        Path | None, typer.Option(help="Also write a report page (HTML).", callback=PAGE)
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(help="Also write the uncertainty over the part (PNG).", callback=PNG),
    ] = None,
    json: Json = False,
) -> None:
    """Choose the touches after which machined points are known best, and say how well."""
    from robotrue.cli.probe_plan import Options
    from robotrue.cli.probe_plan import run as plan_touches

    options = Options(
        touches=touches,
        frame=frame,
        goal=goal,
        run=run,
        tolerance_mm=tolerance_mm,
        touch_sigma_mm=touch_sigma_mm,
        tool_sigma_mm=tool_sigma_mm,
        lean_deg=lean_deg,
        tip_axis=tip_axis,
        report=report,
        picture=picture,
    )
    plan_touches(cell, part, machined, output, options, as_json=json)
