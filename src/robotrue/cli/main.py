"""The ``robotrue`` command: signatures only; each command's work is in the file of its name.

Data go to stdout, everything else to stderr. Exit 0: done. Exit 1: understood, but refused or
failed, with a message that says why (a file that is not there, too). Exit 2: the command line
itself is wrong: an unknown option, a missing argument. Heavy imports happen inside the commands, so
``robotrue --help`` answers at once.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from robotrue import __version__
from robotrue.errors import RobotrueError

app = typer.Typer(
    name="robotrue",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Makes an industrial robot cut where the CAM said.",
)

INTERRUPTED = 130
"""What the command line library makes of Ctrl-C."""
Json = Annotated[bool, typer.Option("--json", help="Machine-readable result on stdout.")]
CellFile = Annotated[Path, typer.Argument(metavar="CELL", help="cell.toml")]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file of `calibrate`.")]


def _version(value: bool) -> None:
    if value:
        sys.stdout.write(f"robotrue {__version__}\n")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Calibrate a robot, know how far to trust it, and compensate its programs."""


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for everything the demo makes.")] = Path(
        "demo-out"
    ),
    data: Annotated[
        Path | None, typer.Option(help="Folder of measured data: the same job on a real UR10.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the virtual cell.")] = 1,
    json: Json = False,
) -> None:
    """Measure, calibrate, validate, compensate and re-measure a virtual cell (or real data)."""
    from robotrue.cli.demo import run

    run(out=out, data=data, seed=seed, as_json=json)


@app.command()
def plan(
    cell: CellFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV of the poses to write.")],
    poses: Annotated[int, typer.Option("--poses", "-n", help="How many, at most.")] = 30,
    region: Annotated[
        str | None,
        typer.Option(help="Where the arm will work: angle_deg=A..B,radius_mm=..,height_mm=.."),
    ] = None,
    program_targets: Annotated[
        Path | None, typer.Option(help="Or the program whose targets it will work at.")
    ] = None,
    within: Annotated[
        str | None, typer.Option(help="Where the reflector may be while measuring, like --region.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="A calibration that the poses are to improve.")
    ] = None,
    payload: Annotated[
        list[str] | None,
        typer.Option(help="KG[,X,Y,Z]: a load that can be measured with; may be repeated."),
    ] = None,
    approach: Annotated[str, typer.Option(help="one-side or as-it-comes.")] = "one-side",
    criterion: Annotated[
        str, typer.Option(help="I: accuracy where the arm will work. D: parameters.")
    ] = "I",
    tolerance_um: Annotated[
        float, typer.Option(help="Stop when the next pose would gain less than this.")
    ] = 0.0,
    candidates: Annotated[int, typer.Option(help="Postures to choose from.")] = 2000,
    seed: Annotated[int, typer.Option(help="Seed of the candidates.")] = 1,
    program: Annotated[
        Path | None, typer.Option(help="Also write a KRL program that measures them (.src).")
    ] = None,
    trigger_output: Annotated[
        int, typer.Option(help="Digital output that triggers the tracker.")
    ] = 17,
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    json: Json = False,
) -> None:
    """Choose the poses that are worth measuring, and say what accuracy to expect."""
    from robotrue.cli.plan import run

    run(
        cell,
        output,
        poses=poses,
        criterion=criterion,
        region=region,
        within=within,
        program_targets=program_targets,
        model_path=model,
        payloads=payload or [],
        approach=approach,
        candidates=candidates,
        tolerance_um=tolerance_um,
        seed=seed,
        program=program,
        trigger_output=trigger_output,
        report=report,
        as_json=json,
    )


@app.command()
def calibrate(
    cell: CellFile,
    measurements: Annotated[list[Path], typer.Argument(metavar="MEAS...", help="Measurements.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Model file to write.")],
    method: Annotated[
        str, typer.Option(help="auto, or one of nominal, geometric, elastic, ripple, gp.")
    ] = "auto",
    mapping: Annotated[
        Path | None, typer.Option(help="Column mapping (TOML) for files of another layout.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    json: Json = False,
) -> None:
    """Learn the robot's error from measured poses and write a model file."""
    from robotrue.cli.calibrate import run

    run(cell, measurements, output, method=method, mapping=mapping, report=report, as_json=json)


@app.command()
def transfer(
    cell: CellFile,
    source: Annotated[
        list[str],
        typer.Option(
            "--source",
            help="NAME=FILE[,region|campaign|unit]: measurements or a model; may be repeated.",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Model file to write.")],
    targets: Annotated[
        list[Path] | None, typer.Argument(metavar="[TARGET...]", help="Target measurements.")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="Column mapping (TOML) for files of another layout.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    curve: Annotated[
        bool, typer.Option("--curve", help="Also accuracy against the number of target poses.")
    ] = False,
    json: Json = False,
) -> None:
    """Carry a calibration to a new region, date or arm with a few poses, under guard."""
    from robotrue.cli.transfer import run

    run(
        cell,
        targets or [],
        source,
        output,
        mapping=mapping,
        report=report,
        curve=curve,
        as_json=json,
    )


@app.command()
def validate(
    model: ModelFile,
    measurements: Annotated[list[Path], typer.Argument(metavar="MEAS...", help="Held-out poses.")],
    mapping: Annotated[Path | None, typer.Option(help="Column mapping (TOML).")] = None,
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    json: Json = False,
) -> None:
    """Say how well a model predicts poses it has not seen."""
    from robotrue.cli.validate import run

    run(model, measurements, mapping=mapping, report=report, as_json=json)


@app.command()
def predict(
    model: ModelFile,
    queries: Annotated[Path, typer.Argument(metavar="QUERIES", help="CSV of joints, wrench.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV to write.")],
    mapping: Annotated[Path | None, typer.Option(help="Column mapping (TOML).")] = None,
    json: Json = False,
) -> None:
    """Predict the error (actual minus commanded) and its standard deviation."""
    from robotrue.cli.predict import run

    run(model, queries, output, mapping=mapping, as_json=json)


@app.command()
def program(
    cell: Annotated[
        Path, typer.Argument(metavar="CELL", help="cell.toml, best one `register` wrote.")
    ],
    toolpaths: Annotated[
        list[Path], typer.Argument(metavar="TOOLPATH...", help="APT/CL data or CSV, one per side.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="KRL program (.src) to write.")],
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
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    json: Json = False,
) -> None:
    """Make a robot program of CAM tool paths, in the frame where the part was found."""
    from robotrue.cli.program import run

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
    program: Annotated[Path, typer.Argument(metavar="PROGRAM", help="Program to compensate.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Program to write.")],
    cell: Annotated[
        Path | None, typer.Option(help="Registered cell whose part frame the program runs in.")
    ] = None,
    part: Annotated[
        str | None, typer.Option(help="Which part or side, where the cell has several.")
    ] = None,
    wrench: Annotated[
        str | None,
        typer.Option(help="Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m."),
    ] = None,
    axis_targets: Annotated[
        bool, typer.Option(help="Compensate axis targets too (PTP {A1 ..}).")
    ] = False,
    max_shift_mm: Annotated[
        float, typer.Option(help="Leave a target alone if it would move further than this.")
    ] = 10.0,
    json: Json = False,
) -> None:
    """Rewrite a program so that the robot lands where it says."""
    from robotrue.cli.compensate import run

    run(
        model,
        program,
        output,
        registered=cell,
        part=part,
        wrench=wrench,
        axis_targets=axis_targets,
        max_shift_mm=max_shift_mm,
        as_json=json,
    )


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
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Every target as CSV.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare two programs target by target: shift, turn, predicted error before and after."""
    from robotrue.cli import diff as command

    command.run(first, second, model_path=model, registered=cell, output=output, as_json=json)


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
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV of the touches to write.")],
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
    report: Annotated[Path | None, typer.Option(help="Also write a report page (HTML).")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Also write the uncertainty over the part (PNG).")
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


@app.command()
def register(
    cell: Annotated[
        Path,
        typer.Argument(metavar="CELL|MODEL", help="cell.toml (nominal arm) or model file."),
    ],
    points: Annotated[Path, typer.Argument(metavar="POINTS", help="CSV of the touches.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Registered cell to write.")],
    touch_sigma_mm: Annotated[
        float, typer.Option(help="One standard deviation per axis of one touch.")
    ] = 0.1,
    robot_sigma_mm: Annotated[
        float | None, typer.Option(help="Of the arm over the part; default: what its model says.")
    ] = None,
    tool_sigma_mm: Annotated[
        float | None,
        typer.Option(help="Of the tip in the flange; 0: unchanged since the model was made."),
    ] = None,
    tolerance_mm: Annotated[
        float | None, typer.Option(help="What machined points must keep, for the verdict.")
    ] = None,
    probe_radius_mm: Annotated[float, typer.Option(help="Of the probe's ball.")] = 0.0,
    fit: Annotated[
        str, typer.Option(help="auto; frame: leave the arm as it is; joint: arm, tool and frame.")
    ] = "auto",
    mesh: Annotated[
        Path | None, typer.Option(help="The part (STL): touches with a normal lie on it.")
    ] = None,
    mesh_unit: Annotated[str, typer.Option(help="mm, m or inch.")] = "mm",
    model_out: Annotated[
        Path | None,
        typer.Option(help="Refined model, where touching moved the arm; default: beside the cell."),
    ] = None,
    frame_format: Annotated[
        list[str] | None,
        typer.Option(help="Also print the frame: krl, rapid, fanuc, yaskawa, ur, g54; repeatable."),
    ] = None,
    frame_number: Annotated[int, typer.Option(help="Of the controller's frame table.")] = 1,
    json: Json = False,
) -> None:
    """Find where the part stands from touched points, and tie it to the model of the arm."""
    from robotrue.cli.register import Options, run

    options = Options(
        touch_sigma_mm=touch_sigma_mm,
        robot_sigma_mm=robot_sigma_mm,
        tool_sigma_mm=tool_sigma_mm,
        tolerance_mm=tolerance_mm,
        probe_radius_mm=probe_radius_mm,
        fit=fit,
        mesh=mesh,
        mesh_unit=mesh_unit,
        model_out=model_out,
        frame_format=tuple(frame_format or ()),
        frame_number=frame_number,
    )
    run(cell, points, output, options, as_json=json)


@app.command()
def inspect(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="Model, cell, measurements or program.")
    ],
    mapping: Annotated[Path | None, typer.Option(help="Column mapping (TOML).")] = None,
    json: Json = False,
) -> None:
    """Say what a file holds: a model, a cell, measurements or a program."""
    from robotrue.cli.inspect import run

    run(path, mapping=mapping, as_json=json)


@app.command(name="map")
def map_errors(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL|CELL", help="Model file; a cell.toml maps its priors.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Picture (.png), table (.csv) or page (.html).")
    ],
    region: Annotated[str, typer.Option(help="cylinder (about joint 1) or cube.")] = "cylinder",
    angle_deg: Annotated[str | None, typer.Option(help="LOW,HIGH of a cylinder.")] = None,
    radius_mm: Annotated[str | None, typer.Option(help="LOW,HIGH of a cylinder.")] = None,
    height_mm: Annotated[str | None, typer.Option(help="LOW,HIGH of a cylinder.")] = None,
    x_mm: Annotated[str | None, typer.Option(help="LOW,HIGH of a cube.")] = None,
    y_mm: Annotated[str | None, typer.Option(help="LOW,HIGH of a cube.")] = None,
    z_mm: Annotated[str | None, typer.Option(help="LOW,HIGH of a cube.")] = None,
    grid: Annotated[str, typer.Option(help="Grid values along each coordinate.")] = "8,8,8",
    sectors: Annotated[int, typer.Option(help="Parts compared, along the angle or along y.")] = 4,
    attitude: Annotated[
        str, typer.Option(help="turning (with the angle about joint 1) or fixed (in base).")
    ] = "turning",
    tool_abc_deg: Annotated[
        str, typer.Option(help="KUKA A,B,C of the point in base; for turning at angle 0.")
    ] = "0,180,0",
    posture_deg: Annotated[
        str | None, typer.Option(help="Model joints of the branch wanted; default: as trained.")
    ] = None,
    at: Annotated[str, typer.Option(help="target (the measured point) or tool.")] = "target",
    json: Json = False,
) -> None:
    """Map the predicted error and its 95 % bound over a region, sector against sector."""
    from robotrue.cli.map import run

    ranges = {
        "angle": angle_deg,
        "radius": radius_mm,
        "height": height_mm,
        "x": x_mm,
        "y": y_mm,
        "z": z_mm,
    }
    run(
        model,
        output,
        region=region,
        ranges=ranges,
        grid=grid,
        sectors=sectors,
        attitude=attitude,
        tool_abc_deg=tool_abc_deg,
        posture_deg=posture_deg,
        at=at,
        as_json=json,
    )


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="deng2022 or feng2018.")],
    robots: Annotated[int, typer.Option(help="Simulated arms.")] = 20,
    scenario: Annotated[
        str, typer.Option(help="deng2022: S0, S1, S2 or S4 with A or B, how rough the arms are.")
    ] = "S2A",
    quick: Annotated[
        bool, typer.Option("--quick", help="A part of the tables, fewer layouts, a shallower hole.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for JSON and CSV of the figures.")
    ] = None,
    json: Json = False,
) -> None:
    """Print a paper's tables beside those of simulated arms (20 arms: about 5 minutes)."""
    from robotrue.cli.reproduce import run

    run(paper, scenario=scenario, robots=robots, quick=quick, out=out, as_json=json)


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
        Path | None, typer.Option("--output", "-o", help="Page (.html) with the error per side.")
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


@app.command(name="warm-up")
def warm_up() -> None:
    """Compile the numeric kernels once, so that the first program does not wait for it."""
    from robotrue.cli.warm_up import run

    run()


def run() -> None:
    """Runs the command line and exits with 0, 1 or 2."""
    try:
        app()
    except RobotrueError as error:
        _report(error)
        raise SystemExit(1) from None
    except SystemExit as stopped:
        if stopped.code != INTERRUPTED:
            raise
        sys.stderr.write("robotrue: stopped; nothing was left half-written.\n")
        raise SystemExit(1) from None
    except BrokenPipeError:
        # Whoever read the result has closed the pipe (``| head``); the flush at exit must not fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def _report(error: RobotrueError) -> None:
    sys.stderr.write(f"robotrue: {error}\n")
    if "--json" in sys.argv:
        import json

        fault = {
            "kind": type(error).__name__,
            "message": error.message,
            "source": error.source,
            "line": error.line,
            "hint": error.hint,
        }
        sys.stdout.write(json.dumps({"error": fault}) + "\n")
