"""A workspace and its files: made, filled, exported, imported, verified, its bin emptied."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.operations.workspace_items import item_result
from robotrue.app.presentation import Facts, PlainResult, count
from robotrue.app.request import InputFile, Option, Output, Request
from robotrue.app.request_fields import HERE, WorkspaceFolder
from robotrue.errors import ArchiveError, ConfigurationError

if TYPE_CHECKING:
    from robotrue.store.bin import Discarded, RecycleBin
    from robotrue.store.exchange import ExchangeTotals
    from robotrue.store.records import ItemRecord
    from robotrue.store.workspace import Workspace


class WorkspaceInitRequest(Request):
    """Folder of the workspace."""

    folder: Annotated[Path, Option(argument="FOLDER")]
    """New or empty folder."""


@operation("workspace_init")
def make_workspace(request: WorkspaceInitRequest, context: Context) -> PlainResult:
    """Create a workspace.

    Raises:
        ConfigurationError: The folder holds something, or its database does not answer.
    """
    from robotrue.store.workspace import Workspace

    with Workspace.create(request.folder) as made:
        database = made.engine.dialect.name
        values = {"workspace": str(request.folder), "id": made.id, "database": database}
    context.inform(f"workspace made in {request.folder}; its database is {database}")
    return PlainResult(values=values)


IMPORTED: Final = ("cell", "measurement", "model", "program")
"""Nouns that come from files."""


class WorkspaceAddRequest(Request):
    """Files to add, and their noun."""

    noun: Annotated[str, Option(argument="NOUN")]
    """cell, measurement, model or program."""
    files: Annotated[tuple[Path, ...], InputFile(argument="FILE...")]
    """Files to import."""
    cell: str | None = None
    """Cell of the measurements: id or name."""
    mapping: Annotated[Path | None, InputFile()] = None
    """Column mapping (TOML) of measurements."""
    name: str | None = None
    """Name of the item; default: that of the file."""
    note: str = ""
    """Note saved with the item."""
    folder: WorkspaceFolder = HERE


@operation("workspace_add")
def add_files(request: WorkspaceAddRequest, context: Context) -> PlainResult:
    """Import files: they are copied and checked.

    Raises:
        ConfigurationError: Another noun, or as many files as it does not take.
    """
    from robotrue.store.workspace import Workspace

    noun = request.noun
    if noun not in IMPORTED:
        raise ConfigurationError(
            f"{noun!r} is not imported from files, expected {', '.join(IMPORTED)}."
        )
    if noun in ("cell", "model") and len(request.files) != 1:
        raise ConfigurationError(f"{len(request.files)} files, expected one {noun}.")
    with Workspace.open(request.folder) as workspace:
        record = _import_files(workspace, request, context)
    context.inform(f"{noun} {record.name!r} imported as {record.id}")
    return item_result(noun, record)


def _import_files(
    workspace: Workspace, request: WorkspaceAddRequest, context: Context
) -> ItemRecord:
    from robotrue.store import cells, models, programs

    name, note = request.name or request.files[0].stem, request.note
    if request.noun == "cell":
        return cells.add(workspace, request.files[0], name=name, note=note)
    if request.noun == "model":
        return models.add(workspace, request.files[0], name=name, note=note)
    if request.noun == "program":
        return programs.add(workspace, request.files, name=request.name, note=note)
    return _import_measurements(workspace, request, context, name)


def _import_measurements(
    workspace: Workspace, request: WorkspaceAddRequest, context: Context, name: str
) -> ItemRecord:
    from robotrue.cell.config import read_cell
    from robotrue.store import cells, items, measurements
    from robotrue.store.nouns import CELL

    if request.cell is None:
        raise ConfigurationError(
            "measurements without the cell they were made in.",
            hint="--cell NAME; robotrue workspace list cell shows them.",
        )
    _, id = items.resolve(workspace, request.cell, CELL.name)
    cell = items.get(workspace, CELL, id)
    with tempfile.TemporaryDirectory() as folder:
        opened = read_cell(cells.copy_cell(workspace, cell, Path(folder)))
        rows = context.measurements(opened, request.files, request.mapping)
    raw = [*request.files, *([] if request.mapping is None else [request.mapping])]
    return measurements.add(workspace, rows, name=name, raw=raw, cell=cell.ref, note=request.note)


class WorkspaceExportRequest(Request):
    """File to export to."""

    file: Annotated[Path, Output(argument="FILE", what="an archive", suffixes=(".zip",))]
    """File (.zip) to write."""
    folder: WorkspaceFolder = HERE


@operation("workspace_export")
def export_workspace(request: WorkspaceExportRequest, context: Context) -> PlainResult:
    """Write the whole workspace to one file."""
    from robotrue.store.exchange import export_project
    from robotrue.store.workspace import Workspace

    file = context.output(request.file)
    with Workspace.open(request.folder) as workspace:
        carried = export_project(workspace, file)
    return _tell_carried(carried, file, "row", "written to", context)


def _tell_carried(
    carried: ExchangeTotals, file: Path, what: str, way: str, context: Context
) -> PlainResult:
    rows = sum(carried.rows.values())
    context.inform(f"{count(rows, what)} and {count(carried.files, 'file')} {way} {file}")
    return PlainResult(values={"file": str(file), "rows": carried.rows, "files": carried.files})


class WorkspaceImportRequest(Request):
    """File to import."""

    file: Annotated[Path, InputFile(argument="FILE")]
    """File of `export`."""
    folder: WorkspaceFolder = HERE


@operation("workspace_import")
def import_workspace(request: WorkspaceImportRequest, context: Context) -> PlainResult:
    """Import all items of an exported file; ids stay.

    Raises:
        ArchiveError: Another file, or a damaged one.
    """
    from robotrue.store.exchange_import import import_project
    from robotrue.store.workspace import Workspace

    file = request.file
    with Workspace.open(request.folder) as workspace:
        carried = import_project(workspace, file)
    return _tell_carried(carried, file, "new row", "imported from", context)


class WorkspaceVerifyRequest(Request):
    """Workspace to verify."""

    folder: WorkspaceFolder = HERE


@operation("workspace_verify")
def verify_workspace(request: WorkspaceVerifyRequest, context: Context) -> PlainResult:
    """Read every file and compare it with its hash; exit 1 if anything is wrong.

    Raises:
        ArchiveError: Something is wrong.
    """
    from robotrue.store.verify import verify
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        found = verify(workspace)
    for fault in found.faults:
        context.inform(fault)
    for name in found.unnamed:
        context.note(f"{name} is a file without a row")
    if found.faults:
        raise ArchiveError(
            f"{count(len(found.faults), 'fault')} in {count(found.items, 'item')} and "
            f"{count(found.files, 'file')}: {found.faults[0]}",
            source=request.folder,
            hint="restore the named items from a backup; all others are whole.",
        )
    size = ("MiB", f"{found.bytes / 2**20:.1f}")
    facts = (("items", str(found.items)), ("files", str(found.files)), size)
    return PlainResult(
        values={
            "items": found.items,
            "files": found.files,
            "bytes": found.bytes,
            "faults": list(found.faults),
            "unnamed": list(found.unnamed),
        },
        shown=(Facts(title="workspace is intact", rows=facts),),
    )


SHOWN: Final = 20
"""Items that are named before the question."""


class WorkspaceEmptyBinRequest(Request):
    """Age of the items to purge."""

    days: Annotated[float, Option(names=("--older-than-days",), least=0.0)] = 30.0
    """Minimum days since the deletion."""
    yes: bool = False
    """Do not ask for confirmation."""
    folder: WorkspaceFolder = HERE


@operation("workspace_empty_bin")
def empty_recycle_bin(request: WorkspaceEmptyBinRequest, context: Context) -> PlainResult:
    """Remove old deleted items permanently, with files that no other item needs.

    Raises:
        ConfigurationError: No terminal to confirm at and no ``--yes``, or the answer was no.
    """
    from robotrue.store.bin import empty_bin, in_bin
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        removed = in_bin(workspace, days=request.days)
        if removed.items and not request.yes:
            _confirm(removed, request.folder, context)
        if removed.items:
            removed = empty_bin(workspace, days=request.days)
    return PlainResult(
        values={
            "removed": _discarded_items(removed.items),
            "needed": _discarded_items(removed.needed),
            "files": removed.files,
            "bytes": removed.bytes,
        },
        shown=(
            Facts(
                title="bin is empty" if removed.items else "nothing in the bin is old enough",
                rows=(
                    ("items permanently removed", str(len(removed.items))),
                    ("files", f"{removed.files}, {removed.bytes / 2**20:.1f} MiB"),
                    ("kept, other items use them", str(len(removed.needed))),
                ),
            ),
        ),
    )


def _confirm(found: RecycleBin, folder: Path, context: Context) -> None:
    for item in found.items[:SHOWN]:
        day = item.deleted.astimezone().strftime("%Y-%m-%d %H:%M")
        context.inform(f"{item.noun} {item.id[:8]} {item.name!r}, deleted {day}")
    if len(found.items) > SHOWN:
        context.inform(f"and {len(found.items) - SHOWN} more")
    size = f"{count(found.files, 'file')} of {found.bytes / 2**20:.1f} MiB"
    answer = context.shell.confirm(
        f"this and {size} cannot be restored; type yes to remove them", "yes"
    )
    if answer is None:
        raise ConfigurationError(
            f"{count(len(found.items), 'item')} and {size} would be permanently removed from "
            f"{folder.name or folder}, and there is no terminal to confirm it.",
            hint="--yes, after an export.",
        )
    if not answer:
        raise ConfigurationError("nothing was removed.", hint="type yes, or give --yes.")


def _discarded_items(items: Sequence[Discarded]) -> list[dict[str, str]]:
    return [
        {"noun": e.noun, "id": e.id, "name": e.name, "deleted": e.deleted.isoformat()}
        for e in items
    ]
