"""``robotrue workspace``: made, carried over, verified."""

from __future__ import annotations

from pathlib import Path

from robotrue.app.outputs import check_output
from robotrue.cli.console import count, emit_facts, emit_json, say
from robotrue.errors import ArchiveError
from robotrue.store.exchange import export_project
from robotrue.store.exchange_import import import_project
from robotrue.store.verify import verify
from robotrue.store.workspace import Workspace


def opened(folder: Path) -> Workspace:
    """Returns the workspace in a folder, opened.

    Raises:
        ConfigurationError: No workspace, or its database does not answer.
    """
    return Workspace.open(folder)


def run_init(folder: Path, *, as_json: bool) -> None:
    """Makes a workspace."""
    with Workspace.create(folder) as made:
        document = {"workspace": str(folder), "id": made.id, "database": made.engine.dialect.name}
    say(f"workspace made in {folder}; its database is {document['database']}")
    if as_json:
        emit_json(document)


def run_export(folder: Path, file: Path, *, as_json: bool) -> None:
    """Writes the workspace to one file."""
    check_output(file, [])
    with opened(folder) as workspace:
        carried = export_project(workspace, file)
    rows = sum(carried.rows.values())
    say(f"{count(rows, 'row')} and {count(carried.files, 'file')} written to {file}")
    if as_json:
        emit_json({"file": str(file), "rows": carried.rows, "files": carried.files})


def run_import(folder: Path, file: Path, *, as_json: bool) -> None:
    """Takes in an exported file."""
    with opened(folder) as workspace:
        carried = import_project(workspace, file)
    rows = sum(carried.rows.values())
    say(f"{count(rows, 'new row')} and {count(carried.files, 'file')} taken in from {file}")
    if as_json:
        emit_json({"file": str(file), "rows": carried.rows, "files": carried.files})


def run_verify(folder: Path, *, as_json: bool) -> None:
    """Reads every file and compares it with its hash.

    Raises:
        ArchiveError: Something is wrong.
    """
    with opened(folder) as workspace:
        found = verify(workspace)
    for fault in found.faults:
        say(fault)
    for name in found.unnamed:
        say(f"note: {name} is a file that no row names")
    if found.faults:
        raise ArchiveError(
            f"{count(len(found.faults), 'fault')} in {count(found.items, 'item')} and "
            f"{count(found.files, 'file')}: {found.faults[0]}",
            source=folder,
            hint="fetch what is missing from a backup; what is not named above is whole.",
        )
    if as_json:
        emit_json(
            {
                "items": found.items,
                "files": found.files,
                "bytes": found.bytes,
                "faults": list(found.faults),
                "unnamed": list(found.unnamed),
            }
        )
        return
    facts = [("items", str(found.items)), ("files", str(found.files))]
    emit_facts("workspace is whole", [*facts, ("MiB", f"{found.bytes / 2**20:.1f}")])
