"""Signatures of the commands about programs: made from tool paths, compensated, compared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, KRL, PAGE
from robotrue.cli.app import Json, app

MaxStep = Annotated[
    float,
    typer.Option(
        metavar="MM",
        help="Refuse (exit 2) a larger step between a target left alone and its compensated "
        "neighbours on a line, arc or spline.",
    ),
]
AllowSteps = Annotated[
    bool, typer.Option("--allow-steps", help="Write a program with larger steps all the same.")
]


@app.command()
def program(
    cell: Annotated[
        Path, typer.Argument(metavar="CELL", help="cell.toml, best one `register` wrote.")
    ],
    toolpaths: Annotated[
        list[Path], typer.Argument(metavar="TOOLPATH...", help="APT/CL data or CSV, one per side.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="KRL program (.src) to write.", callback=KRL)
    ],
    model: Annotated[
        Path | None, typer.Option(help="Also compensate the program with this model.")
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option(help="Part frame, for all sides or one for each; default: of the same name."),
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(help="Part (STL): keep only points inside its largest contour."),
    ] = None,
    margin_mm: Annotated[
        float, typer.Option(help="How far outside the contour points are kept.")
    ] = 0.0,
    cutter: Annotated[
        str | None,
        typer.Option(help="Axis of [tool] from spindle to tip: x, y, z, -x, -y, -z; default z."),
    ] = None,
    lift_mm: Annotated[
        float, typer.Option(help="Height over part and paths before and after each side.")
    ] = 100.0,
    home_deg: Annotated[
        str | None, typer.Option(help="A1,..,A6 where the job begins and ends.")
    ] = None,
    rapid_mm_per_s: Annotated[float, typer.Option(help="Speed of rapid points.")] = 200.0,
    feed_mm_per_min: Annotated[
        float | None, typer.Option(help="Feed of points that cut before any is stated.")
    ] = None,
    blend_mm: Annotated[float, typer.Option(help="$APO.CDIS; 0 stops at every point.")] = 0.2,
    max_shift_mm: Annotated[
        float, typer.Option(help="With --model: leave a target alone that would move further.")
    ] = 10.0,
    max_step: MaxStep = 0.1,
    allow_steps: AllowSteps = False,
    report: Annotated[
        Path | None, typer.Option(help="Also write a report page (HTML).", callback=PAGE)
    ] = None,
    json: Json = False,
) -> None:
    """Make a robot program of CAM tool paths, in the frame where the part was found."""
    from robotrue.cli.program import run
    from robotrue.cli.steps import StepRule

    run(
        cell,
        toolpaths,
        output,
        model_path=model,
        parts=part or [],
        mesh_path=mesh,
        margin_mm=margin_mm,
        cutter=cutter,
        lift_mm=lift_mm,
        home_deg=home_deg,
        rapid_mm_per_s=rapid_mm_per_s,
        feed_mm_per_min=feed_mm_per_min,
        blend_mm=blend_mm,
        max_shift_mm=max_shift_mm,
        steps=StepRule(max_mm=max_step, allow=allow_steps),
        report=report,
        as_json=json,
    )


@app.command()
def compensate(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|CELL",
            help="Model file, or a cell registered with one; another cell.toml changes nothing.",
        ),
    ],
    program: Annotated[
        list[Path],
        typer.Argument(
            metavar="PROGRAM...", help="Program to compensate; several files or a folder: one job."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Program to write; for a job a folder, too.")
    ],
    cell: Annotated[
        Path | None,
        typer.Option(help="Cell whose part frame the program runs in, or that knows its frames."),
    ] = None,
    part: Annotated[
        str | None, typer.Option(help="Which part or side, where the cell has several.")
    ] = None,
    wrench: Annotated[
        str | None,
        typer.Option(help="Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m."),
    ] = None,
    force: Annotated[
        Path | None,
        typer.Option(help="Process force along the path: TOML of rules, or CSV by line or path."),
    ] = None,
    cutter: Annotated[
        str | None,
        typer.Option(help="Axis of the tool from spindle to tip: x, y, z, -x, -y, -z; default z."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="A1,..,A6 in deg before the first target; default: start_deg of the cell."
        ),
    ] = None,
    free_spin: Annotated[
        bool,
        typer.Option(
            "--free-spin",
            help="Choose the rotation about the axis of a rotating tool for stiffness and room.",
        ),
    ] = False,
    axis_targets: Annotated[
        bool, typer.Option(help="Compensate axis targets too (PTP {A1 ..}).")
    ] = False,
    max_shift_mm: Annotated[
        float, typer.Option(help="Leave a target alone if it would move further than this.")
    ] = 10.0,
    max_step: MaxStep = 0.1,
    allow_steps: AllowSteps = False,
    workers: Annotated[
        int | None,
        typer.Option(help="Processes for a long program; default: as many as help; 1: only this."),
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Dask scheduler whose workers do a long program, tcp://...")
    ] = None,
    split: Annotated[
        float | None,
        typer.Option(
            metavar="UM",
            help="Put targets into lines and arcs that bow by more than UM micrometres.",
        ),
    ] = None,
    split_limit: Annotated[
        int, typer.Option(help="With --split: targets put in at most.")
    ] = 100_000,
    deviation: Annotated[
        bool,
        typer.Option(
            "--deviation", help="Report how far lines and arcs are off between their targets."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Rewrite a program so that the robot lands where it says."""
    from robotrue.cli.compensate import Request, run
    from robotrue.cli.long_program import Staff
    from robotrue.cli.split import SplitOptions
    from robotrue.cli.steps import StepRule

    request = Request(
        model=model,
        programs=tuple(program),
        output=output,
        registered=cell,
        part=part,
        wrench=wrench,
        force=force,
        cutter=cutter,
        start=start,
        free_spin=free_spin,
        axis_targets=axis_targets,
        max_shift_mm=max_shift_mm,
        split=SplitOptions(tolerance_um=split, limit=split_limit, deviation=deviation),
        staff=Staff(workers=workers, dask=dask),
        steps=StepRule(max_mm=max_step, allow=allow_steps),
    )
    run(request, as_json=json)


@app.command()
def diff(
    first: Annotated[Path, typer.Argument(metavar="BEFORE", help="Program as CAM made it.")],
    second: Annotated[Path, typer.Argument(metavar="AFTER", help="The same, compensated.")],
    model: Annotated[
        Path | None,
        typer.Option(
            help="Model file: also the predicted error of every target, before and after."
        ),
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="Registered cell with the part frame.")] = None,
    wrench: Annotated[
        str | None, typer.Option(help="With --model: process force, as compensate takes it.")
    ] = None,
    force: Annotated[
        Path | None, typer.Option(help="With --model: process force, as compensate takes it.")
    ] = None,
    cutter: Annotated[
        str | None, typer.Option(help="Axis of the tool from spindle to tip, as for compensate.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(help="With --model: start posture, as compensate takes it.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Every target as CSV.", callback=CSV)
    ] = None,
    json: Json = False,
) -> None:
    """Compare two programs target by target: shift, turn, predicted error before and after."""
    from robotrue.cli import diff as command

    command.run(
        first,
        second,
        model_path=model,
        registered=cell,
        output=output,
        as_json=json,
        wrench=wrench,
        force=force,
        cutter=cutter,
        start=start,
    )
