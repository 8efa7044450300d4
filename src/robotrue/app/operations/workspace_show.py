"""Show one item: what it says, what it rests on, its files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import workspace_fields as fields
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts
from robotrue.app.request import Option, Request
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.store.records import ItemRecord


class WorkspaceShowRequest(Request):
    """Which item, in which version."""

    item: fields.ItemWord
    version: Annotated[int | None, Option(help="Default: the latest.")] = None
    output: Annotated[
        Path | None, Option(names=("--output", "-o"), help="Folder to copy its files to.")
    ] = None
    folder: fields.WorkspaceFolder = fields.HERE


def run(request: WorkspaceShowRequest, context: Context) -> PlainResult:
    """Returns one version of an item; copies its files if a folder is stated.

    Raises:
        ConfigurationError: No such item or folder.
    """
    from robotrue.store import items
    from robotrue.store.layout import copy_files
    from robotrue.store.nouns import noun_of
    from robotrue.store.workspace import Workspace

    output = request.output
    with Workspace.open(request.folder) as workspace:
        noun, id = items.resolve(workspace, request.item)
        record = items.get(workspace, noun_of(noun), id, version=request.version)
        if output is not None:
            if not output.is_dir():
                raise ConfigurationError("no folder.", source=output, hint=f"mkdir -p {output}")
            for path in copy_files(workspace, record, output):
                context.inform(f"written: {path}")
    return fields.item_result(
        noun, record, Facts(title=f"{noun} {record.name}", rows=_facts(noun, record))
    )


def _facts(noun: str, record: ItemRecord) -> tuple[tuple[str, str], ...]:
    values = fields.item_document(noun, record)
    return (
        *(
            (name, fields.value_text(value))
            for name, value in values.items()
            if name not in ("links", "files", "detail")
        ),
        *(
            (each["role"], f"{each['id'][:8]} version {each['version']}")
            for each in values["links"]
        ),
        *((f"file ({each['role']})", each["name"]) for each in values["files"]),
        *(
            (name, fields.value_text(value))
            for name, value in record.detail.items()
            if isinstance(value, str | int | float) and value != ""
        ),
    )


OPERATION: Final = Operation(request=WorkspaceShowRequest, run=run)
