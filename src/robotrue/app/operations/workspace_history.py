"""Show what was done and when."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Table
from robotrue.app.request import Option, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder, time_text
from robotrue.store.query_defaults import LIMIT


class WorkspaceHistoryRequest(Request):
    """Of which item."""

    item: Annotated[
        str | None, Option(argument="[ITEM]", help="None: everything that was done.")
    ] = None
    limit: Annotated[int, Option(help="Entries shown, the newest first.")] = LIMIT
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceHistoryRequest, context: Context) -> PlainResult:
    """Returns what was done, the newest first.

    Raises:
        ConfigurationError: No such item.
    """
    from robotrue.store import items, journal
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        id = None if request.item is None else items.resolve(workspace, request.item)[1]
        page = journal.entries(workspace, item=id, limit=request.limit)
    rows = tuple(
        (
            time_text(entry.at),
            entry.action,
            entry.noun,
            entry.item[:8],
            str(entry.version or ""),
            str(entry.detail.get("name", entry.detail.get("kind", ""))),
        )
        for entry in page.items
    )
    return PlainResult(
        values={
            "total": page.total,
            "entries": [{**asdict(each), "at": each.at.isoformat()} for each in page.items],
        },
        shown=(
            Table(
                title="1 entry" if page.total == 1 else f"{page.total} entries",
                columns=("when", "what", "noun", "id", "version", ""),
                rows=rows,
                words=True,
            ),
        ),
    )


OPERATION: Final = Operation(request=WorkspaceHistoryRequest, run=run)
