"""What the 3-D view draws."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Path, Query
from fastapi.responses import Response

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, PROGRAM
from robotrue.web.api.items_routes import get_item
from robotrue.web.page_context import ServerContext

Id = Annotated[str, Path(max_length=40)]
Version = Annotated[int | None, Query(ge=1, le=1_000_000)]
JSON = "application/json"


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of scenes."""
    routes = APIRouter(tags=["scenes"])
    workspace, folder = server.workspace, str(server.workspace.folder)

    @routes.get("/scenes/cell/{id}")
    async def show_cell(id: Id) -> Response:
        """Arm and frames of a cell."""
        return await _draw_item(server, calls.draw_cell, CELL.name, id)

    @routes.get("/scenes/model/{id}")
    async def show_model(id: Id, version: Version = None) -> Response:
        """Arm and frames of a model's cell, measured errors before and after, predicted field."""
        return await _draw_item(server, calls.draw_model, MODEL.name, id, version)

    @routes.get("/scenes/measurement/{id}")
    async def show_measurement(
        id: Id, model: Annotated[str, Query(max_length=40)], version: Version = None
    ) -> Response:
        """Measured errors of a set before and after, by a model that need not have seen it."""
        record = await asyncio.to_thread(get_item, workspace, MEASUREMENT.name, id, version)
        judge = await asyncio.to_thread(get_item, workspace, MODEL.name, model)
        versions = (id, record.version, model, judge.version)
        answer = await server.answers.once(calls.draw_measurement, folder, *versions)
        return Response(answer, media_type=JSON)

    @routes.get("/programs/{id}/judgement")
    async def judge_program(
        id: Id,
        model: Annotated[str, Query(max_length=40)],
        tolerance_mm: Annotated[float | None, Query(gt=0.0, le=1000.0)] = None,
        strict: bool = False,
        version: Version = None,
    ) -> Response:
        """Predicted errors of a program's targets, and GO or NO-GO against a tolerance.

        A compensated program is compared with the one it was made from, and judged by the model it
        was compensated with; a program as the CAM made it is judged as it stands. Without a
        tolerance there are the predicted errors and no verdict. Axis targets state no place and are
        counted apart, unless the judgement is to be strict.
        """
        program = await asyncio.to_thread(get_item, workspace, PROGRAM.name, id, version)
        judge = await asyncio.to_thread(get_item, workspace, MODEL.name, model)
        versions = (id, program.version, model, judge.version)
        answer = await server.answers.once(
            calls.judge_program, folder, *versions, tolerance_mm, strict
        )
        return Response(answer, media_type=JSON)

    return routes


async def _draw_item(
    server: ServerContext,
    draw: Callable[[str, str, int], bytes],
    noun: str,
    id: str,
    version: int | None = None,
) -> Response:
    record = await asyncio.to_thread(get_item, server.workspace, noun, id, version)
    folder = str(server.workspace.folder)
    answer = await server.answers.once(draw, folder, id, record.version)
    return Response(answer, media_type=JSON)
