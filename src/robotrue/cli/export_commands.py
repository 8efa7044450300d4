"""Signatures of ``robotrue export ...``: the calibrated robot for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, SHEET, URDF
from robotrue.cli.app import Json, ModelFile, app

export = typer.Typer(
    name="export",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Write the calibrated robot for other programs; what they cannot take must be named.",
)
app.add_typer(export)

Urdf = Annotated[Path, typer.Option("--output", "-o", help="File to write.", callback=URDF)]
Table = Annotated[Path, typer.Option("--output", "-o", help="File to write.", callback=CSV)]
Sheet = Annotated[Path, typer.Option("--output", "-o", help="File to write.", callback=SHEET)]
Lossy = Annotated[
    str,
    typer.Option(
        help="Parts that may be left out: geometry, gear, compliance, ripple, backlash, residual."
    ),
]
At = Annotated[str, typer.Option(help="target (the measured point) or tool (of programs).")]


@export.command()
def urdf(
    model: ModelFile, output: Urdf, lossy: Lossy = "", at: At = "target", json: Json = False
) -> None:
    """Write a URDF of the calibrated arm, and what URDF cannot say as JSON beside it."""
    from robotrue.cli.export import run

    run(model, output, kind="urdf", lossy=lossy, at=at, as_json=json)


@export.command()
def dh(
    model: ModelFile, output: Table, lossy: Lossy = "", at: At = "target", json: Json = False
) -> None:
    """Write the calibrated DH table as CSV, with base and tool."""
    from robotrue.cli.export import run

    run(model, output, kind="dh", lossy=lossy, at=at, as_json=json)


@export.command()
def controller(
    model: ModelFile, output: Sheet, lossy: Lossy = "", at: At = "target", json: Json = False
) -> None:
    """Write joint zeros, tool and base fitted to the model: .json, or text for any other name."""
    from robotrue.cli.export import run

    run(model, output, kind="controller", lossy=lossy, at=at, as_json=json)
