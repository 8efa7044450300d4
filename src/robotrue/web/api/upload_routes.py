"""Files sent in as the plain body of a request, and what is made of them.

Uploads become cells, measurements, programs, and the poses of a drift check.
"""

from __future__ import annotations

import asyncio
import functools
import pathlib
from collections.abc import Awaitable, Callable, Sequence
from typing import Annotated, Any, Final, TypeAlias, TypeVar

from fastapi import APIRouter, Path, Query, Request
from pydantic import BaseModel, Field

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import MODEL
from robotrue.web.api.items_routes import get_item, record_document
from robotrue.web.api.jobs_routes import start_job
from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import Quota, find_upload, forget, take_in

R = TypeVar("R")
Files: TypeAlias = Sequence[pathlib.Path]
MappingField: TypeAlias = str | float | bool | list[str | float] | None
UploadId = Annotated[str, Field(pattern="^[0-9a-f]{32}$")]
PLAIN_BODY: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
"""How OpenAPI describes a file that is the body of a request."""


class FromFiles(BaseModel, extra="forbid"):
    """Uploads of which one thing is made.

    Attributes:
        uploads: Ids of uploads, the main file first.
        name: In the workspace; empty: that of the file.
    """

    uploads: Annotated[list[UploadId], Field(min_length=1, max_length=100)]
    name: Annotated[str, Field(max_length=200)] = ""


class Measured(FromFiles):
    """Uploads with measured poses.

    Attributes:
        cell: Id of the cell they were measured in.
        mapping: Fields of a column mapping; None: the layout is found.
    """

    cell: Annotated[str, Field(max_length=40)]
    mapping: dict[str, MappingField | dict[str, MappingField]] | None = None


class CheckPoses(FromFiles, extra="ignore"):
    """Uploads with a few poses measured again.

    Attributes:
        model: Id of the model they are to check.
    """

    uploads: Annotated[list[UploadId], Field(min_length=1, max_length=20)]
    model: Annotated[str, Field(max_length=40)]


class Uploaded(BaseModel):
    """A file that came in; its id names it in what comes next."""

    id: str
    name: str
    size: int
    sha256: str


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of files and of what is made of them."""
    routes = APIRouter()
    quota = Quota(server.workspace, server.settings.upload_total)

    @routes.post("/files", tags=["files"], status_code=201, openapi_extra=PLAIN_BODY)
    async def send_file(
        request: Request, name: Annotated[str, Query(min_length=1, max_length=255)]
    ) -> Uploaded:
        """Keeps the body of the request as a file, for a day unless something is made of it."""
        found = await take_in(server.workspace, name, request.stream(), quota)
        return Uploaded(id=found.id, name=found.name, size=found.size, sha256=found.sha256)

    @routes.delete("/files/{id}", tags=["files"], status_code=204)
    def drop_file(id: Annotated[str, Path(max_length=40)]) -> None:
        """Removes a file of which nothing is to be made."""
        find_upload(server.workspace, id)
        forget(server.workspace, id)

    @routes.post("/cells", tags=["items"], status_code=201)
    async def add_cell(asked: FromFiles) -> dict[str, object]:
        """A cell of a cell.toml and the files it names."""
        return record_document(await import_files(server, calls.import_cell, asked), "cell")

    @routes.post("/programs", tags=["items"], status_code=201)
    async def add_program(asked: FromFiles) -> dict[str, object]:
        """A program of one or more unchanged files."""
        return record_document(await import_files(server, calls.import_program, asked), "program")

    @routes.post("/measurements", tags=["items"], status_code=201)
    async def add_measurements(asked: Measured) -> dict[str, object]:
        """Measured poses, read and checked for plausibility."""
        call = functools.partial(
            calls.import_measurements, cell_id=asked.cell, mapping=asked.mapping
        )
        return record_document(await import_files(server, call, asked), "measurement")

    @routes.post("/drift-checks", tags=["drift checks"], status_code=202)
    async def check_drift(asked: CheckPoses) -> dict[str, object]:
        """Queues the check of the poses, which are a measurement set already."""
        for each in asked.uploads:
            find_upload(server.workspace, each)
        await asyncio.to_thread(get_item, server.workspace, MODEL.name, asked.model)
        call = functools.partial(calls.import_check_poses, model_id=asked.model)
        made = await import_files(server, call, asked)
        return await start_job(server, "drift", {"model": asked.model, "measurements": [made.id]})

    return routes


async def import_files(
    server: ServerContext, call: Callable[[str, Files, str], R], asked: FromFiles
) -> R:
    """Returns the result of a call on uploads, in a separate process."""
    folder = str(server.workspace.folder)
    return await use_uploads(
        server, asked.uploads, lambda paths: server.workers.ask(call, folder, paths, asked.name)
    )


async def use_uploads(
    server: ServerContext, uploads: Sequence[str], make: Callable[[Files], Awaitable[R]]
) -> R:
    """Returns what is made of uploads, which go once something is made of them."""
    made = await make([find_upload(server.workspace, each) for each in uploads])
    for each in uploads:  # only what became something: after a refusal one tries again
        await asyncio.to_thread(forget, server.workspace, each)
    return made
