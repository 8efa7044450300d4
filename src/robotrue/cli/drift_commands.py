"""Signatures of the commands about drift: which poses to measure again, and what they say."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV
from robotrue.cli.app import Json, ModelFile, app


@app.command()
def drift(
    model: ModelFile,
    poses: Annotated[Path, typer.Argument(metavar="POSES", help="5 to 10 poses measured again.")],
    level: Annotated[
        float, typer.Option(help="Share of checks that may call an unchanged robot changed.")
    ] = 0.01,
    mapping: Annotated[Path | None, typer.Option(help="Column mapping (TOML).")] = None,
    json: Json = False,
) -> None:
    """Say whether the robot still is the one that was calibrated: keep, update or recalibrate."""
    from robotrue.cli.drift import run

    run(model, poses, level=level, mapping=mapping, as_json=json)


@app.command(name="drift-plan")
def drift_plan(
    model: ModelFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Sheet (CSV) to write.", callback=CSV)
    ],
    poses: Annotated[int, typer.Option(help="How many; 4 at least.")] = 7,
    seed: Annotated[int, typer.Option(help="Of the draw of candidates.")] = 0,
    json: Json = False,
) -> None:
    """Choose the few poses that show a moved base or tool and a slipped joint best."""
    from robotrue.cli.drift_plan import run

    run(model, output, poses=poses, seed=seed, as_json=json)
