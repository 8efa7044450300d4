"""Signatures of ``robotrue workspace ...`` and ``robotrue jobs ...``."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import ZIP
from robotrue.cli.app import Json, app
from robotrue.errors import MissingExtraError

workspace = typer.Typer(
    name="workspace",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Cells, measurements, models, programs and their history in one folder.",
)
jobs = typer.Typer(
    name="jobs",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Work done in the background of a workspace.",
)
app.add_typer(workspace)
app.add_typer(jobs)


@workspace.callback()
@jobs.callback()
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


Folder = Annotated[
    Path,
    typer.Option(
        "--workspace",
        "-w",
        envvar="ROBOTRUE_WORKSPACE",
        help="Folder of the workspace; its database is in it, or where ROBOTRUE_DB says.",
    ),
]
HERE = Path()
Item = Annotated[
    str, typer.Argument(metavar="ITEM", help="Id, the first characters of one, or a name.")
]
JobArgument = Annotated[str, typer.Argument(metavar="JOB", help="Id, or its first characters.")]


@workspace.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New or empty folder.")],
    json: Json = False,
) -> None:
    """Make a workspace."""
    from robotrue.cli.workspace import run_init

    run_init(folder, as_json=json)


@workspace.command()
def add(
    noun: Annotated[
        str, typer.Argument(metavar="NOUN", help="cell, measurement, model or program.")
    ],
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="What is taken in.")],
    cell: Annotated[
        str | None, typer.Option(help="Cell the measurements were made in: id or name.")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="Column mapping (TOML) of measurements.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Default: that of the file.")] = None,
    note: Annotated[str, typer.Option(help="Kept with it.")] = "",
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Take files in; they are copied, and what they say is checked."""
    from robotrue.cli.workspace_items import run_add

    run_add(folder, noun, files, cell=cell, mapping=mapping, name=name, note=note, as_json=json)


@workspace.command(name="list")
def list_items(
    noun: Annotated[
        str | None,
        typer.Argument(
            metavar="[NOUN]",
            help="cell, measurement, model, program, ...; none: how many of each there are.",
        ),
    ] = None,
    text: Annotated[str, typer.Option(help="Part of the name or the note.")] = "",
    where: Annotated[
        list[str] | None, typer.Option(help="FIELD=VALUE that must hold; may be repeated.")
    ] = None,
    sort: Annotated[str, typer.Option(help="Field; with - before it greatest first.")] = "-created",
    offset: Annotated[int, typer.Option(help="Items left out before the first.")] = 0,
    limit: Annotated[int, typer.Option(help="Items shown.")] = 50,
    deleted: Annotated[bool, typer.Option("--deleted", help="Those that are deleted.")] = False,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Show what there is."""
    from robotrue.cli.workspace_items import run_list

    run_list(
        folder,
        noun,
        text=text,
        where=where or [],
        sort=sort,
        offset=offset,
        limit=limit,
        deleted=deleted,
        as_json=json,
    )


@workspace.command()
def show(
    item: Item,
    version: Annotated[int | None, typer.Option(help="Default: the latest.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to copy its files to.")
    ] = None,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Show one item: what it says, what it rests on, its files."""
    from robotrue.cli.workspace_items import run_show

    run_show(folder, item, version=version, output=output, as_json=json)


@workspace.command()
def history(
    item: Annotated[
        str | None, typer.Argument(metavar="[ITEM]", help="None: everything that was done.")
    ] = None,
    limit: Annotated[int, typer.Option(help="Entries shown, the newest first.")] = 50,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Show what was done and when."""
    from robotrue.cli.workspace_items import run_history

    run_history(folder, item, limit=limit, as_json=json)


@workspace.command()
def delete(item: Item, folder: Folder = HERE, json: Json = False) -> None:
    """Delete an item; everything of it is kept, `undo` brings it back."""
    from robotrue.cli.workspace_items import run_delete

    run_delete(folder, item, as_json=json)


@workspace.command()
def undo(item: Item, folder: Folder = HERE, json: Json = False) -> None:
    """Take the last change of an item back: its deletion, or its latest version."""
    from robotrue.cli.workspace_items import run_undo

    run_undo(folder, item, as_json=json)


@workspace.command(name="empty-bin")
def empty_bin(
    days: Annotated[
        float, typer.Option("--older-than-days", help="Since it was deleted.", min=0.0)
    ] = 30.0,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Remove for good what was deleted long ago and nothing rests on, with its files."""
    from robotrue.cli.workspace_bin import run_empty_bin

    run_empty_bin(folder, days, yes=yes, as_json=json)


@workspace.command(name="export")
def export_all(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="File (.zip) to write.", callback=ZIP)
    ],
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Write the whole workspace to one file."""
    from robotrue.cli.workspace import run_export

    run_export(folder, file, as_json=json)


@workspace.command(name="import")
def import_all(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `export` wrote.")],
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Take in everything of an exported file; ids stay."""
    from robotrue.cli.workspace import run_import

    run_import(folder, file, as_json=json)


@workspace.command()
def verify(folder: Folder = HERE, json: Json = False) -> None:
    """Read every file and compare it with its hash; exit 1 if anything is wrong."""
    from robotrue.cli.workspace import run_verify

    run_verify(folder, as_json=json)


@jobs.command()
def submit(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="calibrate, compensate, plan or validate.")
    ],
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter", "-p", help="NAME=VALUE, a text or JSON; may be repeated: then a list."
        ),
    ] = None,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Ask for a job; a worker (`jobs run`, or the web app) does it."""
    from robotrue.cli.jobs import run_submit

    run_submit(folder, kind, parameter or [], as_json=json)


@jobs.command(name="list")
def list_jobs(
    state: Annotated[
        str | None, typer.Option(help="queued, running, done, failed or cancelled.")
    ] = None,
    limit: Annotated[int, typer.Option(help="Jobs shown, the newest first.")] = 50,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Show the jobs and how far they are."""
    from robotrue.cli.jobs import run_list

    run_list(folder, state=state, limit=limit, as_json=json)


@jobs.command(name="show")
def show_job(job: JobArgument, folder: Folder = HERE, json: Json = False) -> None:
    """Show one job: parameters, remarks, result or error."""
    from robotrue.cli.jobs import run_show

    run_show(folder, job, as_json=json)


@jobs.command()
def cancel(job: JobArgument, folder: Folder = HERE, json: Json = False) -> None:
    """End a job; nothing of it stands."""
    from robotrue.cli.jobs import run_cancel

    run_cancel(folder, job, as_json=json)


@jobs.command(name="run")
def run_jobs(
    until_idle: Annotated[
        bool, typer.Option("--until-idle", help="End when nothing waits.")
    ] = False,
    slots: Annotated[int, typer.Option(help="Jobs at a time.", min=1)] = 1,
    dask: Annotated[
        str | None,
        typer.Option(
            envvar="ROBOTRUE_DASK", help="Address of a Dask scheduler whose workers do the jobs."
        ),
    ] = None,
    folder: Folder = HERE,
    json: Json = False,
) -> None:
    """Do jobs, each in a process of its own, until Ctrl-C."""
    from robotrue.cli.jobs import run_worker_here

    run_worker_here(folder, until_idle=until_idle, slots=slots, dask=dask, as_json=json)
