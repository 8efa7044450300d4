"""Which model the pages show when their address names none."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, Field

from robotrue.store.nouns import MODEL
from robotrue.web import models
from robotrue.web.api.documents import record_document
from robotrue.web.api.items_routes import get_item
from robotrue.web.page_context import ServerContext


class ChosenModel(BaseModel, extra="forbid"):
    """The model all pages show.

    Attributes:
        model: Id.
    """

    model: Annotated[str, Field(min_length=1, max_length=40)]


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of the choice."""
    routes = APIRouter(tags=["items"])
    workspace = server.workspace

    @routes.put("/chosen-model")
    async def choose_model(asked: ChosenModel) -> dict[str, object]:
        """The document that says which model all pages show from now on."""
        await asyncio.to_thread(get_item, workspace, MODEL.name, asked.model)
        return record_document(
            await asyncio.to_thread(models.choose, workspace, asked.model), "document"
        )

    @routes.delete("/chosen-model", status_code=204)
    async def choose_newest() -> None:
        """No model is chosen: the pages show the one that was made first."""
        await asyncio.to_thread(models.choose_none, workspace)

    return routes
