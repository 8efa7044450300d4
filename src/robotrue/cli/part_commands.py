"""Signatures of the commands about the part: what to touch, and two-sided slots."""

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


@app.command(name="slot-test")
def slot_test(
    measured: Annotated[
        Path | None,
        typer.Argument(metavar="[STEPS.csv]", help="Measured steps: slot,step_mm. None: simulate."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the virtual cell.")] = 1,
    way: Annotated[
        str,
        typer.Option(help="Way shown beside the paper's: calibrated, planned-30, per-side, ..."),
    ] = "calibrated",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Page (.html) with the error per side.", callback=PAGE),
    ] = None,
    across: Annotated[
        str, typer.Option(help="Measured: direction of the step in the part, x,y,z.")
    ] = "1,0,0",
    first_abc_deg: Annotated[
        str, typer.Option(help="Measured: KUKA A,B,C of the tool in the part, first side.")
    ] = "0,-90,-90",
    second_abc_deg: Annotated[
        str, typer.Option(help="Measured: the same, second side.")
    ] = "0,-90,90",
    per_side: Annotated[
        bool,
        typer.Option("--per-side", help="Measured: each side had a frame or clamping its own."),
    ] = False,
    json: Json = False,
) -> None:
    """Cut slots from two sides in the virtual cell, or say what measured steps can tell."""
    from robotrue.cli.slot_test import run_measured, run_simulated

    if measured is None:
        run_simulated(seed=seed, way=way, output=output, as_json=json)
        return
    run_measured(
        measured,
        across=across,
        first=first_abc_deg,
        second=second_abc_deg,
        per_side=per_side,
        as_json=json,
    )
