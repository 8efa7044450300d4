"""Items of a workspace: listed, shown, their history, deleted, brought back."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, PlainResult, Table, time_text
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import HERE, OUTPUT, WorkspaceFolder
from robotrue.core.provenance import simulation_mark
from robotrue.errors import ConfigurationError
from robotrue.store.query_defaults import LIMIT, SORT

if TYPE_CHECKING:
    from robotrue.store.records import ItemRecord
    from robotrue.store.workspace import Workspace


ItemWord: TypeAlias = Annotated[
    str, Option(argument="ITEM", help="Id, its first characters, or a name.")
]
COLUMNS: Final = {
    "robot": ("maker", "dof"),
    "tool": (),
    "cell": ("robot", "frame"),
    "measurement": ("poses", "dof", "frame"),
    "model": ("method", "robot", "made_by"),
    "registration": ("verdict", "frames", "method"),
    "program": ("stage", "dialect", "bytes"),
    "document": ("kind",),
    "drift-check": ("verdict", "poses", "p_value"),
}
"""Columns of the list of each noun, besides id, name, version and time."""
WHOLE: Final = ("poses", "dof", "version", "frames", "bytes", "file_count", "full_poses")
"""Fields that hold whole numbers."""


class WorkspaceListRequest(Request):
    """Query and order of the list."""

    noun: Annotated[str | None, Option(argument="[NOUN]")] = None
    """cell, measurement, model, program, ...; default: the number of each."""
    text: str = ""
    """Part of the name or the note."""
    where: tuple[str, ...] = ()
    """Condition FIELD=VALUE; may be repeated."""
    sort: str = SORT
    """Sort field; with a leading -, largest first."""
    offset: int = 0
    """Number of items to skip."""
    limit: int = LIMIT
    """Items shown."""
    deleted: bool = False
    """Show deleted items."""
    folder: WorkspaceFolder = HERE


@operation("workspace_list")
def list_items(request: WorkspaceListRequest, context: Context) -> PlainResult:
    """List the items.

    Raises:
        ConfigurationError: No workspace, or an invalid noun, field or condition.
    """
    from robotrue.store import items
    from robotrue.store.nouns import noun_of
    from robotrue.store.records import ItemQuery
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        if request.noun is None:
            return _count_items(workspace, request)
        query = ItemQuery(
            text=request.text,
            where=dict(_parse_condition(each) for each in request.where),
            sort=request.sort,
            offset=request.offset,
            limit=request.limit,
            deleted=request.deleted,
        )
        page = items.search(workspace, noun_of(request.noun), query)
    noun, offset, shown = request.noun, request.offset, len(page.items)
    return PlainResult(
        values={
            "total": page.total,
            "offset": offset,
            "items": [_item_document(noun, record) for record in page.items],
        },
        shown=(
            Table(
                title=f"{noun}: {offset + 1 if shown else 0} to {offset + shown} of {page.total}",
                columns=("id", "name", "version", "created", *COLUMNS[noun], ""),
                rows=tuple(_item_row(noun, record) for record in page.items),
                words=True,
            ),
        ),
    )


def _item_row(noun: str, record: ItemRecord) -> tuple[str, ...]:
    from robotrue.store.records import provenance_of_record

    return (
        record.id[:8],
        record.name,
        str(record.version),
        time_text(record.created),
        *(_value_text(getattr(record, column)) for column in COLUMNS[noun]),
        simulation_mark(provenance_of_record(record)),
    )


def _count_items(workspace: Workspace, request: WorkspaceListRequest) -> PlainResult:
    from robotrue.store import items
    from robotrue.store.nouns import NOUNS
    from robotrue.store.records import ItemQuery

    query = ItemQuery(text=request.text, deleted=request.deleted, limit=1)
    totals = {name: items.search(workspace, noun, query).total for name, noun in NOUNS.items()}
    rows = tuple((name, str(total)) for name, total in totals.items())
    return PlainResult(
        values={"nouns": totals}, shown=(Table(title="", columns=("", "items"), rows=rows),)
    )


def _parse_condition(text: str) -> tuple[str, str | int]:
    field, equals, value = text.partition("=")
    if not equals:
        raise ConfigurationError(f"--where {text!r}, expected FIELD=VALUE.", hint="--where dof=6")
    if field in WHOLE:
        if not value.lstrip("-").isdigit():
            raise ConfigurationError(f"--where {text!r}, expected a whole number.")
        return field, int(value)
    return field, value


class WorkspaceShowRequest(Request):
    """Item and version to show."""

    item: ItemWord
    version: int | None = None
    """Version; default: the latest."""
    output: Annotated[Path | None, Option(names=OUTPUT)] = None
    """Folder to copy its files to."""
    folder: WorkspaceFolder = HERE


@operation("workspace_show")
def show_item(request: WorkspaceShowRequest, context: Context) -> PlainResult:
    """Show one item: its content, its sources, its files.

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
    return item_result(
        noun, record, Facts(title=f"{noun} {record.name}", rows=_item_facts(noun, record))
    )


def _item_facts(noun: str, record: ItemRecord) -> tuple[tuple[str, str], ...]:
    values = _item_document(noun, record)
    return (
        *(
            (name, _value_text(value))
            for name, value in values.items()
            if name not in ("links", "files", "detail")
        ),
        *(
            (each["role"], f"{each['id'][:8]} version {each['version']}")
            for each in values["links"]
        ),
        *((f"file ({each['role']})", each["name"]) for each in values["files"]),
        *(
            (name, _value_text(value))
            for name, value in record.detail.items()
            if isinstance(value, str | int | float) and value != ""
        ),
    )


class WorkspaceHistoryRequest(Request):
    """Item whose history to show."""

    item: Annotated[str | None, Option(argument="[ITEM]")] = None
    """Item; default: all changes."""
    limit: int = LIMIT
    """Entries shown, the newest first."""
    folder: WorkspaceFolder = HERE


@operation("workspace_history")
def show_history(request: WorkspaceHistoryRequest, context: Context) -> PlainResult:
    """Show the history of changes.

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


class WorkspaceDeleteRequest(Request):
    """Item to delete."""

    item: ItemWord
    folder: WorkspaceFolder = HERE


@operation("workspace_delete")
def delete_item(request: WorkspaceDeleteRequest, context: Context) -> PlainResult:
    """Delete an item; `undo` restores it.

    Raises:
        ConfigurationError: No such item.
    """
    from robotrue.store import items
    from robotrue.store.nouns import noun_of
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        noun, id = items.resolve(workspace, request.item)
        record = items.delete(workspace, noun_of(noun), id)
    context.inform(f"{noun} {record.name!r} deleted; robotrue workspace undo {id[:8]} restores it")
    return item_result(noun, record)


class WorkspaceUndoRequest(Request):
    """Item whose last change to undo."""

    item: ItemWord
    folder: WorkspaceFolder = HERE


@operation("workspace_undo")
def undo_change(request: WorkspaceUndoRequest, context: Context) -> PlainResult:
    """Undo the last change of an item: its deletion, or its latest version.

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


def item_result(noun: str, record: ItemRecord, *shown: Block) -> PlainResult:
    """Returns one version of an item as a result."""
    from robotrue.store.records import provenance_of_record

    return PlainResult(
        values=_item_document(noun, record), shown=shown, provenance=provenance_of_record(record)
    )


def _item_document(noun: str, record: ItemRecord) -> dict[str, Any]:
    """One version of an item as JSON values."""
    from robotrue.store.records import provenance_of_record

    values = asdict(record)
    links, files = values.pop("links"), values.pop("attachments")
    values["created"] = record.created.isoformat()
    values["links"] = [{"role": each["role"], **each["to"]} for each in links]
    values = {"noun": noun, **values, "files": list(files)}
    return {"simulated": provenance_of_record(record).simulated, **values}


def _value_text(value: object) -> str:
    """A value of a record as text."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
