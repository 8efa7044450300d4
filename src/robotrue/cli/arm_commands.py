"""Signatures of the commands about the arm: plan, calibrate, transfer, validate, predict, map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.cli.app import Json, app


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
