"""Commands of commands whose commands are made from operations: their help."""

from __future__ import annotations

from typing import Final

import typer

from robotrue.cli.app import app

HELP: Final = {
    "drill": "Square the drill to the surface: a foot's readings, corrected.",
    "dynamics": "The dynamic error of milling: frequency response, force, prediction.",
}

for name, text in HELP.items():
    app.add_typer(
        typer.Typer(
            name=name,
            no_args_is_help=True,
            add_completion=False,
            pretty_exceptions_enable=False,
            rich_markup_mode=None,
            help=text,
        )
    )
