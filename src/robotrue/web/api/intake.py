"""Uploads become cells, measurements and programs."""

from __future__ import annotations

import asyncio
import json
from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel, Field

from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import forget, uploaded
from robotrue.web.workers import Fact

UploadId = Annotated[str, Field(pattern="^[0-9a-f]{32}$")]


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
    mapping: dict[str, str | float | bool | list[str | float] | None] | None = None


def router(server: ServerContext) -> APIRouter:
    """Returns the routes that make items of uploads."""
    routes = APIRouter(tags=["items"])
    workspace = server.workspace

    async def made(question: str, asked: FromFiles, *facts: Fact) -> Response:
        paths = json.dumps([str(uploaded(workspace, each)) for each in asked.uploads])
        folder = str(workspace.folder)
        record = await server.workers.ask(question, folder, paths, asked.name, *facts)
        for each in asked.uploads:  # only what became something: after a refusal one tries again
            await asyncio.to_thread(forget, workspace, each)
        return Response(record, status_code=201, media_type="application/json")

    @routes.post("/cells", status_code=201)
    async def add_cell(asked: FromFiles) -> Response:
        """A cell of a cell.toml and the files it names."""
        return await made("intake.add_cell", asked)

    @routes.post("/programs", status_code=201)
    async def add_program(asked: FromFiles) -> Response:
        """A program of one or more files, as they stand."""
        return await made("intake.add_program", asked)

    @routes.post("/measurements", status_code=201)
    async def add_measurements(asked: Measured) -> Response:
        """Measured poses, read and checked for plausibility."""
        mapping = "" if asked.mapping is None else json.dumps(asked.mapping)
        return await made("intake.add_measurements", asked, asked.cell, mapping)

    return routes
