"""Report pages of the workspace, shown as they are: no script runs in them, nothing is loaded."""

from __future__ import annotations

import asyncio
from typing import Annotated, Final

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response

from robotrue.web.api.items_routes import get_item
from robotrue.web.page_context import ServerContext
from robotrue.web.problems import MissingError

SHUT: Final = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""A report holds what users named things; whatever stands in it, it can only be read."""
ROLES: Final = frozenset({"report", "file"})


def reports_router(server: ServerContext) -> APIRouter:
    """Returns the route ``/reports``."""
    router = APIRouter(include_in_schema=False)

    @router.get("/reports/{noun}/{id}/{sha256}")
    async def show(
        noun: Annotated[str, Path(max_length=40)],
        id: Annotated[str, Path(max_length=40)],
        sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")],
        version: Annotated[int | None, Query(ge=1, le=1_000_000)] = None,
    ) -> Response:
        record = await asyncio.to_thread(get_item, server.workspace, noun, id, version)
        for each in record.attachments:
            page = each.name.lower().endswith((".html", ".htm"))
            if each.sha256 == sha256 and each.role in ROLES and page:
                path = await asyncio.to_thread(server.workspace.path_of, sha256)
                headers = {"Content-Security-Policy": SHUT}
                return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)
        raise MissingError(f"{noun} {record.name!r} has no report {sha256[:12]}.")

    return router
