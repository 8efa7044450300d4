"""Signatures of the commands about the dynamic error: ``robotrue dynamics ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, FORCE, MODEL
from robotrue.cli.app import Json, app

dynamics = typer.Typer(
    name="dynamics",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="The dynamic error of milling: frequency response, force, prediction.",
)
app.add_typer(dynamics)


@dynamics.command()
def predict(
    frf: Annotated[
        Path, typer.Option(help="Frequency response of the tool: CSV, UFF58 (.uff, .unv) or MAT.")
    ],
    force: Annotated[Path, typer.Option(help="Recorded force on the tool: CSV, TDMS or MAT.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="CSV of the error to write.", callback=CSV)
    ],
    static_um_per_n: Annotated[
        str | None,
        typer.Option(
            "--static-um-per-n", help="Static load test: xx=1.1,yy=0.9,yx=0.1 (response first)."
        ),
    ] = None,
    between: Annotated[
        str,
        typer.Option(help="Between the lines: auto (what rebuilds them best), lines or modes."),
    ] = "auto",
    padding_s: Annotated[
        float | None,
        typer.Option(help="Zeros behind the record; default: twice as long as it rings."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Also draw force, error and response (PNG, SVG or PDF)."),
    ] = None,
    json: Json = False,
) -> None:
    """Predict how far the tool is pushed along a force record."""
    from robotrue.cli.dynamics_predict import run

    run(
        frf,
        force,
        output,
        static=static_um_per_n,
        between=between,
        padding=padding_s,
        report=report,
        as_json=json,
    )


@dynamics.command()
def frf(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Hammer records (CSV), one per axis hit, or one response."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Receptance to write: .csv or .uff."),
    ] = None,
    modes: Annotated[
        Path | None, typer.Option(help="Also write the fitted modes.", callback=MODEL)
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option(help="Length of a segment; default: up to the next hit.")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(help="Where the exponential window ends, 0..1; default: none if it decays."),
    ] = None,
    static_um_per_n: Annotated[
        str | None,
        typer.Option(
            "--static-um-per-n", help="Static load test: xx=1.1,yy=0.9,yx=0.1 (response first)."
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Also draw size, phase, coherence (PNG, SVG or PDF)."),
    ] = None,
    json: Json = False,
) -> None:
    """Make a frequency response of hammer hits, or check one; fit its modes."""
    from robotrue.cli.dynamics_frf import run

    run(
        files,
        output,
        modes_path=modes,
        duration=duration_s,
        window=window,
        static=static_um_per_n,
        report=report,
        as_json=json,
    )


@dynamics.command()
def force(
    cut: Annotated[Path, typer.Argument(metavar="CUT", help="Cutter, cut and material (TOML).")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Force record (CSV); with --along a table for `compensate --force`; with "
            "--slots the cutting data (TOML).",
            callback=FORCE,
        ),
    ] = None,
    slots: Annotated[
        Path | None,
        typer.Option(help="Mean forces of slots at several feeds: gives the coefficients."),
    ] = None,
    along: Annotated[
        Path | None, typer.Option(help="Depth and width along a path: path_mm,depth_mm,width_mm.")
    ] = None,
    measured: Annotated[
        Path | None, typer.Option(help="A recorded force of the same cut, set beside the model.")
    ] = None,
    rate_hz: Annotated[float, typer.Option(help="Samples per second of the record.")] = 20000.0,
    duration_s: Annotated[float, typer.Option(help="Length of the record.")] = 1.0,
    json: Json = False,
) -> None:
    """Predict the force of milling, or find its coefficients in slotting tests."""
    from robotrue.cli.dynamics_force import run

    run(
        cut,
        output,
        slots=slots,
        along=along,
        measured=measured,
        rate=rate_hz,
        duration=duration_s,
        as_json=json,
    )


Direction = Annotated[
    str,
    typer.Option(
        help="Base direction in which the error counts positive; write --direction=X,Y,Z."
    ),
]


@dynamics.command()
def fit(
    windows: Annotated[Path, typer.Argument(metavar="WINDOWS", help="Measured windows (CSV).")],
    cell: Annotated[Path, typer.Option(help="cell.toml with tool and joint stiffness.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Deviation model to write.", callback=MODEL)
    ],
    direction: Direction = "0,-1,0",
    frf: Annotated[
        Path | None,
        typer.Option(help="Response the windows were predicted with, axes of base."),
    ] = None,
    json: Json = False,
) -> None:
    """Learn what the prediction misses, from windows with measured error."""
    from robotrue.cli.dynamics_deviation import fit as run

    run(windows, cell, output, direction=direction, frf=frf, as_json=json)


@dynamics.command()
def validate(
    windows: Annotated[Path, typer.Argument(metavar="WINDOWS", help="Measured windows (CSV).")],
    cell: Annotated[
        Path | None, typer.Option(help="cell.toml: learn from a part, judge on the rest.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="Model of `dynamics fit`: judge it on these windows.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="With --model: CSV of every window's estimate.", callback=CSV
        ),
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(help="random, blocks, passes or unseen; default: all that the data allow."),
    ] = None,
    known: Annotated[
        str | None, typer.Option(help="Pass that `unseen` learns from; default: the first.")
    ] = None,
    direction: Direction = "0,-1,0",
    seed: Annotated[int, typer.Option(help="Of the random split.")] = 0,
    frf: Annotated[
        Path | None,
        typer.Option(help="Response the windows were predicted with, axes of base."),
    ] = None,
    json: Json = False,
) -> None:
    """Say how well the dynamic error is predicted where nothing was learned."""
    from robotrue.cli.dynamics_deviation import validate as run

    run(
        windows,
        cell,
        model_path=model,
        output=output,
        direction=direction,
        kinds=split or (),
        known=known,
        seed=seed,
        frf=frf,
        as_json=json,
    )


@dynamics.command()
def sensor(
    poses: Annotated[
        Path,
        typer.Argument(
            metavar="POSES", help="Readings at rest, one row per pose of the wrist (CSV)."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Mass, centre and offsets to write.", callback=MODEL),
    ] = None,
    json: Json = False,
) -> None:
    """Find what hangs on a force sensor at the flange: mass, centre of mass, offsets."""
    from robotrue.cli.dynamics_sensor import run

    run(poses, output, as_json=json)
