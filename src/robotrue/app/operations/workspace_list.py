"""Show what there is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import workspace_fields as fields
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Table
from robotrue.app.request import Option, Request
from robotrue.errors import ConfigurationError
from robotrue.store.query_defaults import LIMIT, SORT

if TYPE_CHECKING:
    from robotrue.store.records import ItemRecord
    from robotrue.store.workspace import Workspace

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
    """Which items, in which order."""

    noun: Annotated[
        str | None,
        Option(
            argument="[NOUN]",
            help="cell, measurement, model, program, ...; none: how many of each there are.",
        ),
    ] = None
    text: Annotated[str, Option(help="Part of the name or the note.")] = ""
    where: Annotated[
        tuple[str, ...], Option(help="FIELD=VALUE that must hold; may be repeated.")
    ] = ()
    sort: Annotated[str, Option(help="Field; with - before it greatest first.")] = SORT
    offset: Annotated[int, Option(help="Items left out before the first.")] = 0
    limit: Annotated[int, Option(help="Items shown.")] = LIMIT
    deleted: Annotated[bool, Option(help="Those that are deleted.")] = False
    folder: fields.WorkspaceFolder = fields.HERE


def run(request: WorkspaceListRequest, context: Context) -> PlainResult:
    """Returns a page of items, or how many there are of each noun.

    Raises:
        ConfigurationError: No workspace, or a noun, field or condition that cannot be.
    """
    from robotrue.store import items
    from robotrue.store.nouns import noun_of
    from robotrue.store.records import ItemQuery
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        if request.noun is None:
            return _counts(workspace, request)
        query = ItemQuery(
            text=request.text,
            where=dict(_condition(each) for each in request.where),
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
            "items": [fields.item_document(noun, record) for record in page.items],
        },
        shown=(
            Table(
                title=f"{noun}: {offset + 1 if shown else 0} to {offset + shown} of {page.total}",
                columns=("id", "name", "version", "created", *COLUMNS[noun], ""),
                rows=tuple(_row(noun, record) for record in page.items),
                words=True,
            ),
        ),
    )


def _row(noun: str, record: ItemRecord) -> tuple[str, ...]:
    from robotrue.core.provenance import simulation_mark
    from robotrue.store.records import provenance_of_record

    return (
        record.id[:8],
        record.name,
        str(record.version),
        fields.time_text(record.created),
        *(fields.value_text(getattr(record, column)) for column in COLUMNS[noun]),
        simulation_mark(provenance_of_record(record)),
    )


def _counts(workspace: Workspace, request: WorkspaceListRequest) -> PlainResult:
    from robotrue.store import items
    from robotrue.store.nouns import NOUNS
    from robotrue.store.records import ItemQuery

    query = ItemQuery(text=request.text, deleted=request.deleted, limit=1)
    totals = {name: items.search(workspace, noun, query).total for name, noun in NOUNS.items()}
    rows = tuple((name, str(total)) for name, total in totals.items())
    return PlainResult(
        values={"nouns": totals}, shown=(Table(title="", columns=("", "items"), rows=rows),)
    )


def _condition(text: str) -> tuple[str, str | int]:
    field, equals, value = text.partition("=")
    if not equals:
        raise ConfigurationError(f"--where {text!r}, expected FIELD=VALUE.", hint="--where dof=6")
    if field in WHOLE:
        if not value.lstrip("-").isdigit():
            raise ConfigurationError(f"--where {text!r}, expected a whole number.")
        return field, int(value)
    return field, value


OPERATION: Final = Operation(request=WorkspaceListRequest, run=run)
