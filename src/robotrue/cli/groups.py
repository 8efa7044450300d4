"""Commands of commands whose commands are made from operations: their help, and what they need."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Final

import typer
from typer.core import TyperGroup

from robotrue.cli.app import app
from robotrue.errors import MissingExtraError

HELP: Final = {
    "record": "What the service recorded: what is in it, streams as CSV.",
    "sense": "Sense the tool's error online; `sense CELL ...` is `sense run CELL ...`.",
    "simulate": (
        "Simulated controllers and sensors for `sense`, and a drilling head for `drill run`."
    ),
    "workspace": "Cells, measurements, models, programs and their history in one folder.",
    "jobs": "Work done in the background of a workspace.",
}


class RunFirst(TyperGroup):
    """A group in which ``sense CELL ...`` means ``sense run CELL ...``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Returns what is left after the name of the command was put in where it is missing."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


def require_store() -> None:
    """Passes if the packages of the store are installed.

    Raises:
        MissingExtraError: One is not.
    """
    for package in ("sqlalchemy", "alembic", "pyarrow"):
        if find_spec(package) is None:
            raise MissingExtraError(
                f"workspaces need the package {package}, which is not installed.",
                hint="pip install 'robotrue[store]'.",
            )


NEEDS: Final[dict[str, Callable[[], None]]] = {"workspace": require_store, "jobs": require_store}
"""What is checked before a command of a group."""

for name, text in HELP.items():
    app.add_typer(
        typer.Typer(
            name=name,
            cls=RunFirst if name == "sense" else TyperGroup,
            callback=NEEDS.get(name),
            no_args_is_help=True,
            add_completion=False,
            pretty_exceptions_enable=False,
            rich_markup_mode=None,
            help=text,
        )
    )
