"""Take files in; they are copied, and what they say is checked."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder, item_result
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.store.records import ItemRecord
    from robotrue.store.workspace import Workspace

IMPORTED: Final = ("cell", "measurement", "model", "program")
"""Nouns that come from files."""


class WorkspaceAddRequest(Request):
    """Which files, as which noun."""

    noun: Annotated[str, Option(argument="NOUN", help="cell, measurement, model or program.")]
    files: Annotated[tuple[Path, ...], InputFile(argument="FILE...", help="Files to import.")]
    cell: Annotated[str | None, Option(help="Cell the measurements were made in: id or name.")] = (
        None
    )
    mapping: Annotated[Path | None, InputFile(help="Column mapping (TOML) of measurements.")] = None
    name: Annotated[str | None, Option(help="Default: that of the file.")] = None
    note: Annotated[str, Option(help="Kept with it.")] = ""
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceAddRequest, context: Context) -> PlainResult:
    """Imports files as one item.

    Raises:
        ConfigurationError: Another noun, or as many files as it does not take.
    """
    from robotrue.store.workspace import Workspace

    noun = request.noun
    if noun not in IMPORTED:
        raise ConfigurationError(
            f"{noun!r} is not taken in from files, expected {', '.join(IMPORTED)}."
        )
    if noun in ("cell", "model") and len(request.files) != 1:
        raise ConfigurationError(f"{len(request.files)} files, expected one {noun}.")
    with Workspace.open(request.folder) as workspace:
        record = _import(workspace, request, context)
    context.inform(f"{noun} {record.name!r} taken in as {record.id}")
    return item_result(noun, record)


def _import(workspace: Workspace, request: WorkspaceAddRequest, context: Context) -> ItemRecord:
    from robotrue.store import cells, models, programs

    name, note = request.name or request.files[0].stem, request.note
    if request.noun == "cell":
        return cells.add(workspace, request.files[0], name=name, note=note)
    if request.noun == "model":
        return models.add(workspace, request.files[0], name=name, note=note)
    if request.noun == "program":
        return programs.add(workspace, request.files, name=request.name, note=note)
    return _measurement(workspace, request, context, name)


def _measurement(
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


OPERATION: Final = Operation(request=WorkspaceAddRequest, run=run)
