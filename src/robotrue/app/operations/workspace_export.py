"""Write the whole workspace to one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import count
from robotrue.app.request import Output, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder


class WorkspaceExportRequest(Request):
    """Where to."""

    file: Annotated[
        Path,
        Output(
            argument="FILE", what="an archive", suffixes=(".zip",), help="File (.zip) to write."
        ),
    ]
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceExportRequest, context: Context) -> PlainResult:
    """Writes the workspace to one file."""
    from robotrue.store.exchange import export_project
    from robotrue.store.workspace import Workspace

    file = context.output(request.file)
    with Workspace.open(request.folder) as workspace:
        carried = export_project(workspace, file)
    rows = sum(carried.rows.values())
    context.inform(f"{count(rows, 'row')} and {count(carried.files, 'file')} written to {file}")
    return PlainResult(values={"file": str(file), "rows": carried.rows, "files": carried.files})


OPERATION: Final = Operation(request=WorkspaceExportRequest, run=run)
