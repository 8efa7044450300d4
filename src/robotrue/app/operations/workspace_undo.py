"""Take the last change of an item back: its deletion, or its latest version."""

from __future__ import annotations

from typing import Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Request
from robotrue.app.workspace_fields import HERE, ItemWord, WorkspaceFolder, item_result


class WorkspaceUndoRequest(Request):
    """Which item."""

    item: ItemWord
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceUndoRequest, context: Context) -> PlainResult:
    """Takes the last change of an item back.

    Raises:
        ConfigurationError: No such item, or nothing to take back.
    """
    from robotrue.store import items
    from robotrue.store.nouns import noun_of
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        noun, id = items.resolve(workspace, request.item)
        record = items.undo(workspace, noun_of(noun), id)
    state = "deleted again" if record.deleted else "as it was"
    context.inform(f"{noun} {record.name!r} is {state}, version {record.version}")
    return item_result(noun, record)


OPERATION: Final = Operation(request=WorkspaceUndoRequest, run=run)
