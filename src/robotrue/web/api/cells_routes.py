"""Cells from a form and from their text: previewed before saving, never overwritten."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse, Response
from pydantic import BaseModel, Field

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import CELL, CellRecord
from robotrue.web.api.items_routes import JSON, Id, Version, get_item, record_document
from robotrue.web.api.upload_routes import Files, UploadId, use_uploads
from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import find_upload

Typed = Annotated[str, Field(max_length=40)] | float | int | None


class Form(BaseModel):
    """Values typed into the form of a cell.

    Attributes:
        robot: Name of a preset; empty: the arm is that of a file.
        arm: Upload with a DH table (TOML, CSV), a URDF, or the factory calibration of a UR arm
            (YAML), in place of a preset.
        convention: Of a DH table that does not state its own.
        maker: That counts the axes of the arm of a file; empty: not known.
        frame: Of measured positions.
        numbers: The fields, as typed.
    """

    robot: Annotated[str, Field(max_length=100)]
    arm: UploadId | None = None
    convention: Annotated[str, Field(pattern="^(dh|mdh)$")] = "dh"
    maker: Annotated[str, Field(max_length=40)] = ""
    frame: Annotated[str, Field(pattern="^(base|unknown)$")] = "base"
    numbers: dict[Annotated[str, Field(max_length=40)], Typed] = {}


class CellToml(BaseModel):
    """The text of a cell.toml.

    Attributes:
        text: Of the file.
        name: Of a new cell.
        uploads: Files that the text of a new cell names.
        version: Of the cell that was changed; the text becomes its next.
    """

    text: Annotated[str, Field(min_length=1, max_length=200_000)]
    name: Annotated[str, Field(max_length=200)] = ""
    uploads: Annotated[list[UploadId], Field(max_length=100)] = []
    version: Annotated[int, Field(ge=1, le=1_000_000)] | None = None


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of cells that are made here."""
    routes = APIRouter(tags=["items"])
    workspace, folder = server.workspace, str(server.workspace.folder)

    @routes.get("/presets")
    async def list_presets() -> Response:
        """Returns every robot for a cell, and the numbers of its form."""
        return Response(await server.answers.once(calls.list_presets), media_type=JSON)

    @routes.post("/cells/form")
    async def describe_cell(form: Form) -> Response:
        """The cell.toml of a form, or the faults of its fields; nothing is saved."""
        stated = {**form.numbers, **form.model_dump(exclude={"numbers", "arm"})}
        if form.arm is not None:
            stated["arm"] = str(find_upload(workspace, form.arm))
        answer = await server.workers.ask(calls.describe_cell, stated)
        return Response(answer, media_type=JSON)

    @routes.post("/cells/text", status_code=201)
    async def keep_cell(stated: CellToml) -> dict[str, object]:
        """A new cell from the text of a cell.toml."""
        name = stated.name or "cell"

        def save(paths: Files) -> Awaitable[CellRecord]:
            return server.workers.ask(calls.save_cell_text, folder, stated.text, name, "", 0, paths)

        return record_document(await use_uploads(server, stated.uploads, save), CELL.name)

    @routes.post("/cells/{id}/text", status_code=201)
    async def change_cell(id: Id, stated: CellToml) -> dict[str, object]:
        """The new version of a cell with another text; the one before stays."""
        record = await asyncio.to_thread(get_item, workspace, CELL.name, id)
        version = record.version if stated.version is None else stated.version
        made = await server.workers.ask(calls.save_cell_text, folder, stated.text, "", id, version)
        return record_document(made, CELL.name)

    @routes.post("/sample-project", status_code=201)
    async def add_sample_project() -> dict[str, object]:
        """The practice cell, added with simulated poses and a program to compensate."""
        made = await server.workers.ask(calls.add_sample_project, folder)
        return record_document(made, CELL.name)

    @routes.get("/cells/{id}/text", response_class=PlainTextResponse)
    async def read_cell(id: Id, version: Version = None) -> Response:
        """The text of a cell's file."""
        record = await asyncio.to_thread(get_item, workspace, CELL.name, id, version)
        answer = await server.workers.ask(calls.read_cell_text, folder, id, record.version)
        return PlainTextResponse(answer)

    return routes
