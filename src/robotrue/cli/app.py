"""The application every command registers with, and the option that most of them share."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from robotrue.version import __version__

app = typer.Typer(
    name="robotrue",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Calibrate industrial robots and compensate machining programs.",
)

Json = Annotated[bool, typer.Option("--json", help="Machine-readable result on stdout.")]


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
