"""Items of the workspace: listed, shown, downloaded, deleted and restored."""

from __future__ import annotations

from asyncio import to_thread
from dataclasses import fields
from datetime import datetime
from typing import Annotated, Any, Final

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response
from pydantic import BaseModel, Field

from robotrue.errors import ConfigurationError
from robotrue.store import items, journal
from robotrue.store.nouns import MODEL, NOUNS, Noun, noun_of
from robotrue.store.query_defaults import LIMIT, SORT
from robotrue.store.records import Attachment, ItemRecord
from robotrue.store.records import ItemQuery as Asked
from robotrue.store.workspace import Workspace
from robotrue.web import models
from robotrue.web.page_context import ServerContext
from robotrue.web.problems import MissingError, missing_if_unknown

NounName = Annotated[str, Path(description=f"One of {', '.join(NOUNS)}.", max_length=40)]
Id = Annotated[str, Path(max_length=40)]
Digest = Annotated[str, Path(pattern="^[0-9a-f]{64}$")]
Version = Annotated[int | None, Query(ge=1, le=1_000_000)]
Suffix = Annotated[str, Query(pattern="^[A-Za-z0-9_-]{0,40}$")]
JSON: Final = "application/json"
CSV: Final[dict[int | str, dict[str, Any]]] = {
    200: {"content": {"text/csv": {"schema": {"type": "string"}}}}
}
"""How OpenAPI describes an answer of :func:`csv_file`."""


SHUT: Final = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""A report contains names from users; this makes it read-only, whatever it contains."""
ROLES: Final = frozenset({"report", "file"})


class ItemListing(BaseModel):
    """One page of a query's result."""

    items: list[dict[str, object]]
    total: int
    offset: int


class Change(BaseModel, extra="forbid"):
    """Another name or note; an omitted field stays."""

    name: str | None = None
    note: str | None = None


class ChosenModel(BaseModel, extra="forbid"):
    """The model all pages show.

    Attributes:
        model: Id.
    """

    model: Annotated[str, Field(min_length=1, max_length=40)]


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of items."""
    routes = APIRouter(tags=["items"])
    workspace = server.workspace

    @routes.get("/items/{noun}")
    def list_items(
        noun: NounName,
        text: Annotated[str, Query(max_length=200)] = "",
        sort: Annotated[str, Query(max_length=40)] = SORT,
        offset: Annotated[int, Query(ge=0, le=10_000_000)] = 0,
        limit: Annotated[int, Query(ge=1, le=items.MOST)] = LIMIT,
        deleted: bool = False,
    ) -> ItemListing:
        """The latest versions of all items of a noun, a page of them."""
        asked = Asked(text=text, sort=sort, offset=offset, limit=limit, deleted=deleted)
        page = items.search(workspace, _noun(noun), asked)
        shown = [record_document(each, noun) for each in page.items]
        return ItemListing(items=shown, total=page.total, offset=page.offset)

    @routes.get("/items/{noun}/{id}")
    def show_item(noun: NounName, id: Id, version: Version = None) -> dict[str, object]:
        """One version of an item, the latest if none is named."""
        return record_document(get_item(workspace, noun, id, version), noun)

    @routes.get("/items/{noun}/{id}/versions")
    def list_versions(noun: NounName, id: Id) -> ItemListing:
        """All versions of an item, the first first."""
        get_item(workspace, noun, id)
        every = items.versions(workspace, _noun(noun), id)
        return ItemListing(
            items=[record_document(each, noun) for each in every], total=len(every), offset=0
        )

    @routes.get("/items/{noun}/{id}/files/{sha256}", response_class=FileResponse)
    def download(
        noun: NounName, id: Id, sha256: Digest, version: Version = None, suffix: Suffix = ""
    ) -> FileResponse:
        """A file of an item, under the name it came with, or with a suffix to the name."""
        record = get_item(workspace, noun, id, version)
        for each in record.attachments:
            if each.sha256 == sha256:
                return FileResponse(
                    workspace.path_of(sha256),
                    filename=_with_suffix(each.name.replace("/", "_"), suffix),
                    media_type="application/octet-stream",
                )
        raise MissingError(f"{noun} {record.name!r} has no file {sha256[:12]}.")

    _offer_changes(routes, workspace)
    return routes


def _with_suffix(name: str, suffix: str) -> str:
    stem, dot, form = name.rpartition(".")
    return f"{stem}{suffix}.{form}" if dot else name + suffix


def _offer_changes(routes: APIRouter, workspace: Workspace) -> None:
    """Adds the routes of changes to items, and that of the journal they are written to."""

    @routes.patch("/items/{noun}/{id}")
    def change_item(noun: NounName, id: Id, change: Change) -> dict[str, object]:
        """The new version of an item with another name or note."""
        get_item(workspace, noun, id)
        if change.name is None and change.note is None:
            raise ConfigurationError("neither another name nor another note.", hint="name, note")
        changed = items.change(workspace, _noun(noun), id, name=change.name, note=change.note)
        return record_document(changed, noun)

    @routes.delete("/items/{noun}/{id}")
    def delete_item(noun: NounName, id: Id) -> dict[str, object]:
        """Returns the version that marks the item as deleted; nothing of it is lost."""
        get_item(workspace, noun, id)
        return record_document(items.delete(workspace, _noun(noun), id), noun)

    @routes.post("/items/{noun}/{id}/undo")
    def undo(noun: NounName, id: Id, version: Version = None) -> dict[str, object]:
        """The item as it was before its latest version; if that is no longer the one named: 409."""
        get_item(workspace, noun, id)
        return record_document(items.undo(workspace, _noun(noun), id, version=version), noun)

    @routes.get("/journal")
    def list_journal(
        item: Annotated[str | None, Query(max_length=40)] = None,
        offset: Annotated[int, Query(ge=0, le=10_000_000)] = 0,
        limit: Annotated[int, Query(ge=1, le=items.MOST)] = LIMIT,
    ) -> ItemListing:
        """Journal of changes, the newest first."""
        page = journal.entries(workspace, item=item, offset=offset, limit=limit)
        shown = [
            {
                "at": each.at.isoformat(),
                "action": each.action,
                "noun": each.noun,
                "item": each.item,
                "version": each.version,
                "detail": dict(each.detail),
            }
            for each in page.items
        ]
        return ItemListing(items=shown, total=page.total, offset=page.offset)

    @routes.put("/chosen-model")
    def choose_model(asked: ChosenModel) -> dict[str, object]:
        """Returns the document that sets the model shown by all pages from now on."""
        get_item(workspace, MODEL.name, asked.model)
        return record_document(models.choose(workspace, asked.model), "document")

    @routes.delete("/chosen-model", status_code=204)
    def choose_newest() -> None:
        """No model is chosen: the pages show the one that was made first."""
        models.choose_none(workspace)


def _noun(name: str) -> Noun[ItemRecord]:
    with missing_if_unknown():
        return noun_of(name)


def get_item(workspace: Workspace, noun: str, id: str, version: int | None = None) -> ItemRecord:
    """Returns an item that an address names.

    Raises:
        MissingError: There is none.
    """
    with missing_if_unknown():
        return items.get(workspace, noun_of(noun), id, version=version)


def csv_file(text: str | bytes, name: str) -> Response:
    """Returns a table that browsers keep under a name."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(text, media_type="text/csv; charset=utf-8", headers=headers)


def record_document(record: ItemRecord, noun: str) -> dict[str, object]:
    """Returns a record as JSON values; its files with the address they are fetched from."""
    out: dict[str, object] = {"noun": noun}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.name == "links":
            value = [{"role": e.role, "id": e.to.id, "version": e.to.version} for e in value]
        elif field.name == "attachments":
            value = [_file(each, record, noun) for each in value]
        elif isinstance(value, datetime):
            value = value.isoformat()
        out[field.name] = value
    return out


def _file(each: Attachment, record: ItemRecord, noun: str) -> dict[str, object]:
    where = f"/api/items/{noun}/{record.id}/files/{each.sha256}?version={record.version}"
    return {"role": each.role, "name": each.name, "sha256": each.sha256, "href": where}


def reports_router(server: ServerContext) -> APIRouter:
    """Returns the route ``/reports``: pages of reports as they are, no script runs in them."""
    router = APIRouter(include_in_schema=False)

    @router.get("/reports/{noun}/{id}/{sha256}")
    async def show(noun: NounName, id: Id, sha256: Digest, version: Version = None) -> Response:
        record = await to_thread(get_item, server.workspace, noun, id, version)
        for each in record.attachments:
            page = each.name.lower().endswith((".html", ".htm"))
            if each.sha256 == sha256 and each.role in ROLES and page:
                path = await to_thread(server.workspace.path_of, sha256)
                headers = {"Content-Security-Policy": SHUT}
                return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)
        raise MissingError(f"{noun} {record.name!r} has no report {sha256[:12]}.")

    return router
