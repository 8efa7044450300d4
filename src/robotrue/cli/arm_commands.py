"""Signatures of the commands about the arm: plan, calibrate, transfer, validate, predict, map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import MODEL, PAGE
from robotrue.cli.app import CellFile, Json, app


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
def transfer(
    cell: CellFile,
    source: Annotated[
        list[str],
        typer.Option(
            "--source",
            help="NAME=FILE[,region|campaign|unit]: measurements or a model; may be repeated.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Model file to write.", callback=MODEL)
    ],
    targets: Annotated[
        list[Path] | None, typer.Argument(metavar="[TARGET...]", help="Target measurements.")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="Column mapping (TOML) for files of another layout.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also write a report page (HTML).", callback=PAGE)
    ] = None,
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
