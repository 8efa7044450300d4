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
