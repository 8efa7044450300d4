"""Signatures of the commands about records of the service: ``robotrue record ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV
from robotrue.cli.app import Json, app

record = typer.Typer(
    name="record",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="What the service recorded: what is in it, streams as CSV.",
)
app.add_typer(record)

RecordFolder = Annotated[Path, typer.Argument(metavar="RECORD", help="Folder of `sense --record`.")]
SkipDamage = Annotated[
    bool, typer.Option("--skip-damage", help="Go on behind damage inside a segment.")
]


@record.command()
def export(
    folder: RecordFolder,
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV to write.", callback=CSV)],
    stream: Annotated[
        str, typer.Option(help="joints, force (as a replay reads them) or estimates.")
    ] = "estimates",
    skip_damage: SkipDamage = False,
    json: Json = False,
) -> None:
    """Write a stream of a record as CSV."""
    from robotrue.cli.record import run_export

    run_export(folder, output, stream=stream, skip_damage=skip_damage, as_json=json)


@record.command()
def info(folder: RecordFolder, skip_damage: SkipDamage = False, json: Json = False) -> None:
    """Check a record frame by frame and say what is in it."""
    from robotrue.cli.record import run_info

    run_info(folder, skip_damage=skip_damage, as_json=json)
