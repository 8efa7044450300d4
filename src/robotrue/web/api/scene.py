"""What the 3-D view draws."""

from __future__ import annotations

from collections import OrderedDict
from typing import Annotated, Final

from fastapi import APIRouter, Path, Query
from fastapi.responses import Response

from robotrue.store import items
from robotrue.store.nouns import CELL, MODEL
from robotrue.web.bench import House
from robotrue.web.workers import Fact

KEPT: Final = 4
"""Answers kept in memory; a version of an item never changes, so neither does its picture."""
Id = Annotated[str, Path(max_length=40)]


def router(house: House) -> APIRouter:
    """Returns the routes of scenes."""
    routes = APIRouter(tags=["scenes"])
    workspace, kept = house.workspace, OrderedDict[tuple[str, str, int], bytes]()

    async def once(key: tuple[str, str, int], question: str, *facts: Fact) -> Response:
        if key not in kept:
            kept[key] = await house.workers.ask(question, str(workspace.folder), *facts)
            while len(kept) > KEPT:
                kept.popitem(last=False)
        kept.move_to_end(key)
        return Response(kept[key], media_type="application/json")

    @routes.get("/scenes/cell/{id}")
    async def show_cell(id: Id) -> Response:
        """Arm and frames of a cell."""
        record = items.get(workspace, CELL, id)
        return await once(("cell", id, record.version), "scene.cell_scene", id)

    @routes.get("/scenes/model/{id}")
    async def show_model(
        id: Id, version: Annotated[int | None, Query(ge=1, le=1_000_000)] = None
    ) -> Response:
        """Arm and frames of a model's cell, measured errors before and after, predicted field."""
        record = items.get(workspace, MODEL, id, version=version)
        return await once(("model", id, record.version), "scene.model_scene", id, record.version)

    return routes
