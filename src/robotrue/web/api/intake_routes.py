"""Uploads become cells, measurements and programs."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, TypeAlias, TypeVar

from fastapi import APIRouter
from pydantic import BaseModel, Field

from robotrue.app.workbench import workbench_calls as calls
from robotrue.web.api.documents import record_document
from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import find_upload, forget

R = TypeVar("R")
MappingField: TypeAlias = str | float | bool | list[str | float] | None
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
    mapping: dict[str, MappingField | dict[str, MappingField]] | None = None


def router(server: ServerContext) -> APIRouter:
    """Returns the routes that make items of uploads."""
    routes = APIRouter(tags=["items"])

    @routes.post("/cells", status_code=201)
    async def add_cell(asked: FromFiles) -> dict[str, object]:
        """A cell of a cell.toml and the files it names."""
        return record_document(await import_files(server, calls.import_cell, asked), "cell")

    @routes.post("/programs", status_code=201)
    async def add_program(asked: FromFiles) -> dict[str, object]:
        """A program of one or more files, as they stand."""
        return record_document(await import_files(server, calls.import_program, asked), "program")

    @routes.post("/measurements", status_code=201)
    async def add_measurements(asked: Measured) -> dict[str, object]:
        """Measured poses, read and checked for plausibility."""
        call = functools.partial(calls.import_measurements, cell=asked.cell, mapping=asked.mapping)
        return record_document(await import_files(server, call, asked), "measurement")

    return routes


async def import_files(
    server: ServerContext, call: Callable[[str, Sequence[Path], str], R], asked: FromFiles
) -> R:
    """Returns what a call makes of uploads, which go once something is made of them."""
    workspace = server.workspace
    paths = [find_upload(workspace, each) for each in asked.uploads]
    made = await server.workers.ask(call, str(workspace.folder), paths, asked.name)
    for each in asked.uploads:  # only what became something: after a refusal one tries again
        await asyncio.to_thread(forget, workspace, each)
    return made
