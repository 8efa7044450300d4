"""Signatures of the commands about the dynamic error: ``robotrue dynamics ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV of the error to write.")],
    static_um_per_N: Annotated[
        str | None,
        typer.Option(
            "--static-um-per-N", help="Static load test: xx=1.1,yy=0.9,yx=0.1 (response first)."
        ),
    ] = None,
    between: Annotated[
        str,
        typer.Option(help="Between the lines: auto (what rebuilds them best), lines or modes."),
    ] = "auto",
    padding_s: Annotated[
        float | None, typer.Option(help="Zeros behind the record; default: as long as it rings.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also draw force, error and response (PNG, SVG or PDF).")
    ] = None,
    json: Json = False,
) -> None:
    """Predict how far the tool is pushed along a force record."""
    from robotrue.cli.dynamics_predict import run

    run(
        frf,
        force,
        output,
        static=static_um_per_N,
        between=between,
        padding=padding_s,
        report=report,
        as_json=json,
    )
