"""Plans of poses to measure."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Path, Query
from fastapi.responses import Response

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import DOCUMENT
from robotrue.web.api.items_routes import get_item
from robotrue.web.page_context import ServerContext

Id = Annotated[str, Path(max_length=40)]
Version = Annotated[int | None, Query(ge=1, le=1_000_000)]


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of plans."""
    routes = APIRouter(tags=["plans"])
    workspace, folder = server.workspace, str(server.workspace.folder)

    @routes.get("/plans/{id}")
    async def show_plan(id: Id, version: Version = None) -> Response:
        """Poses, what to expect of them, how the instrument sees them, and their scene."""
        record = await asyncio.to_thread(get_item, workspace, DOCUMENT.name, id, version)
        answer = await server.answers.once(calls.show_plan, folder, id, record.version)
        return Response(answer, media_type="application/json")

    return routes
