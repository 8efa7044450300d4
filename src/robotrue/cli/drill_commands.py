"""Signatures of the commands about the drilling normal: ``robotrue drill ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.cli.app import Json, app

drill = typer.Typer(
    name="drill",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Square the drill to the surface: a foot's readings, corrected.",
)
app.add_typer(drill)

FootFile = Annotated[Path, typer.Argument(metavar="FOOT", help="Foot file (TOML).")]
CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Clamps with known tilts (CSV or workbook).")
]
DrillModel = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file of `drill fit`.")]


@drill.command()
def fit(
    foot: FootFile,
    campaign: CampaignFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="Model file to write.")],
    kind: Annotated[
        str,
        typer.Option(
            help="auto (what wins on held-out forces and tilts), patent, interactions, quadratic, "
            "cubic, gp or physics."
        ),
    ] = "auto",
    json: Json = False,
) -> None:
    """Learn what makes a foot's readings wrong."""
    from robotrue.cli.drill import run_fit

    run_fit(foot, campaign, output, kind=kind, as_json=json)


@drill.command()
def evaluate(
    model: DrillModel,
    test: Annotated[Path, typer.Argument(metavar="TEST", help="Clamps the fit has not seen.")],
    foot: Annotated[
        Path | None, typer.Option(help="Foot file, where the readings are not less their zero.")
    ] = None,
    json: Json = False,
) -> None:
    """Say what tilt one move leaves: uncorrected, by the patent's regression, by the model."""
    from robotrue.cli.drill import run_evaluate

    run_evaluate(model, test, foot=foot, as_json=json)


@drill.command()
def adjust(
    model: DrillModel,
    reading: Annotated[str, typer.Option(help="d1,d2,d3 in mm, less their zero.")],
    force: Annotated[float, typer.Option(help="Clamp force in N.")],
    z: Annotated[float, typer.Option(help="Position of the Z axis in mm.")],
    at: Annotated[
        str | None, typer.Option(help="A,B of the machine now, in deg; default 0,0.")
    ] = None,
    approach: Annotated[
        str, typer.Option(help="How the foot came down; default the usual way.")
    ] = "",
    json: Json = False,
) -> None:
    """Give the one move that squares the spindle to the surface under the foot."""
    from robotrue.cli.drill import run_adjust

    run_adjust(model, reading=reading, force=force, z_mm=z, at=at, approach=approach, as_json=json)
