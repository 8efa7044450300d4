"""Drilling: campaigns, models and journals imported, journals followed."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query

from robotrue.app.workbench import workbench_calls as calls
from robotrue.drilling.drill_defaults import JOURNAL
from robotrue.store.nouns import DOCUMENT
from robotrue.web.api.items_routes import get_item, record_document
from robotrue.web.api.upload_routes import FromFiles, import_files
from robotrue.web.drill_journals import Entries, entries_after, journal_path
from robotrue.web.page_context import ServerContext
from robotrue.web.problems import MissingError

After = Annotated[int, Query(ge=0, le=1 << 40)]


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of drilling."""
    routes = APIRouter(tags=["drilling"])
    workspace = server.workspace

    @routes.post("/drilling", status_code=201)
    async def add_drilling(asked: FromFiles) -> dict[str, object]:
        """A campaign with its foot.toml, a model of robotrue drill, or a journal."""
        made = await import_files(server, calls.import_drilling, asked)
        return record_document(made, DOCUMENT.name)

    @routes.get("/drilling/journals/{name}")
    def follow_journal(name: Annotated[str, Path(max_length=120)], after: After = 0) -> Entries:
        """Lines of a journal in the workspace's folder ``drilling``, from a byte on."""
        path = journal_path(workspace, name)
        return entries_after(path, after, name=name)

    @routes.get("/drilling/kept-journals/{id}")
    def read_journal(id: Annotated[str, Path(max_length=40)], after: After = 0) -> Entries:
        """Lines of an imported journal, from a byte on."""
        record = get_item(workspace, DOCUMENT.name, id)
        files = record.files("file")
        if getattr(record, "kind", "") != JOURNAL or len(files) != 1:
            raise MissingError(f"{record.name!r} is no journal.")
        path = workspace.path_of(files[0].sha256)
        return entries_after(path, after, name=files[0].name)

    return routes
