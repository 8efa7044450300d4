"""Make a workspace."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Option, Request


class WorkspaceInitRequest(Request):
    """Where."""

    folder: Annotated[Path, Option(argument="FOLDER", help="New or empty folder.")]


def run(request: WorkspaceInitRequest, context: Context) -> PlainResult:
    """Makes a workspace.

    Raises:
        ConfigurationError: The folder holds something, or its database does not answer.
    """
    from robotrue.store.workspace import Workspace

    with Workspace.create(request.folder) as made:
        database = made.engine.dialect.name
        values = {"workspace": str(request.folder), "id": made.id, "database": database}
    context.inform(f"workspace made in {request.folder}; its database is {database}")
    return PlainResult(values=values)


OPERATION: Final = Operation(request=WorkspaceInitRequest, run=run)
