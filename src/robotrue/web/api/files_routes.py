"""Files sent in, as the plain body of a request: written to disk as they come."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request
from pydantic import BaseModel

from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import Quota, find_upload, forget, take_in


class Uploaded(BaseModel):
    """A file that came in; its id names it in what comes next."""

    id: str
    name: str
    size: int
    sha256: str


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of files."""
    routes = APIRouter(tags=["files"])
    quota = Quota(server.workspace, server.settings.upload_total)

    @routes.post(
        "/files",
        status_code=201,
        openapi_extra={
            "requestBody": {
                "required": True,
                "content": {
                    "application/octet-stream": {"schema": {"type": "string", "format": "binary"}}
                },
            }
        },
    )
    async def send_file(
        request: Request, name: Annotated[str, Query(min_length=1, max_length=255)]
    ) -> Uploaded:
        """Keeps the body of the request as a file, for a day unless something is made of it."""
        found = await take_in(server.workspace, name, request.stream(), quota)
        return Uploaded(id=found.id, name=found.name, size=found.size, sha256=found.sha256)

    @routes.delete("/files/{id}", status_code=204)
    def drop_file(id: Annotated[str, Path(max_length=40)]) -> None:
        """Removes a file of which nothing is to be made."""
        find_upload(server.workspace, id)
        forget(server.workspace, id)

    return routes
