"""Contents of the 3-D view: cells, models, measured sets, programs, plans."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated, Concatenate, ParamSpec

from fastapi import APIRouter, Query
from fastapi.responses import Response

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import CELL, DOCUMENT, MEASUREMENT, MODEL, PROGRAM
from robotrue.web.api.items_routes import JSON, Id, Version, get_item
from robotrue.web.page_context import ServerContext

P = ParamSpec("P")


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of scenes."""
    routes = APIRouter(tags=["scenes"])

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
        judge = await asyncio.to_thread(get_item, server.workspace, MODEL.name, model)
        draw = calls.draw_measurement
        return await _draw_item(server, draw, MEASUREMENT.name, id, version, model, judge.version)

    @routes.get("/programs/{id}/judgement")
    async def judge_program(
        id: Id,
        model: Annotated[str, Query(max_length=40)],
        tolerance_mm: Annotated[float | None, Query(gt=0.0, le=1000.0)] = None,
        strict: bool = False,
        version: Version = None,
    ) -> Response:
        """Predicted errors of a program's targets, and GO or NO-GO against a tolerance.

        A compensated program is compared with the one it was made from, and checked with the model
        it was compensated with; a program from CAM is checked as it is. Without a tolerance there
        are predicted errors and no verdict. Axis targets have no Cartesian position and are counted
        separately, unless the check is strict.
        """
        judge = await asyncio.to_thread(get_item, server.workspace, MODEL.name, model)
        stated = (model, judge.version, tolerance_mm, strict)
        return await _draw_item(server, calls.judge_program, PROGRAM.name, id, version, *stated)

    @routes.get("/plans/{id}")
    async def show_plan(id: Id, version: Version = None) -> Response:
        """Poses, what to expect of them, how the instrument sees them, and their scene."""
        return await _draw_item(server, calls.show_plan, DOCUMENT.name, id, version)

    return routes


async def _draw_item(
    server: ServerContext,
    draw: Callable[Concatenate[str, str, int, P], bytes],
    noun: str,
    id: str,
    version: int | None = None,
    *args: P.args,
    **kwargs: P.kwargs,
) -> Response:
    """Answers a call about one version of an item, the latest if none is stated."""
    record = await asyncio.to_thread(get_item, server.workspace, noun, id, version)
    folder = str(server.workspace.folder)
    answer = await server.answers.once(draw, folder, id, record.version, *args, **kwargs)
    return Response(answer, media_type=JSON)
