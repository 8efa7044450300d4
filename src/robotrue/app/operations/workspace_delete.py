"""Delete an item; everything of it is kept, `undo` brings it back."""

from __future__ import annotations

from typing import Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Request
from robotrue.app.workspace_fields import HERE, ItemWord, WorkspaceFolder, item_result


class WorkspaceDeleteRequest(Request):
    """Which item."""

    item: ItemWord
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceDeleteRequest, context: Context) -> PlainResult:
    """Deletes an item.

    Raises:
        ConfigurationError: No such item.
    """
    from robotrue.store import items
    from robotrue.store.nouns import noun_of
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        noun, id = items.resolve(workspace, request.item)
        record = items.delete(workspace, noun_of(noun), id)
    context.inform(
        f"{noun} {record.name!r} deleted; robotrue workspace undo {id[:8]} brings it back"
    )
    return item_result(noun, record)


OPERATION: Final = Operation(request=WorkspaceDeleteRequest, run=run)
