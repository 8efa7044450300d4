"""Take in everything of an exported file; ids stay."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import count
from robotrue.app.request import InputFile, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder


class WorkspaceImportRequest(Request):
    """Which file."""

    file: Annotated[Path, InputFile(argument="FILE", help="What `export` wrote.")]
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceImportRequest, context: Context) -> PlainResult:
    """Imports an exported file.

    Raises:
        ArchiveError: Another file, or a damaged one.
    """
    from robotrue.store.exchange_import import import_project
    from robotrue.store.workspace import Workspace

    file = request.file
    with Workspace.open(request.folder) as workspace:
        carried = import_project(workspace, file)
    rows = sum(carried.rows.values())
    context.inform(
        f"{count(rows, 'new row')} and {count(carried.files, 'file')} taken in from {file}"
    )
    return PlainResult(values={"file": str(file), "rows": carried.rows, "files": carried.files})


OPERATION: Final = Operation(request=WorkspaceImportRequest, run=run)
