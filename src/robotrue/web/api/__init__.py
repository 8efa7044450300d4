"""The HTTP interface under ``/api``: what the pages use, open to everybody's own programs."""

from __future__ import annotations

from fastapi import APIRouter

from robotrue.web.api import (
    cells,
    chosen_model,
    drift,
    drilling,
    files,
    intake,
    items,
    jobs,
    live,
    plan,
    scene,
    touching,
)
from robotrue.web.page_context import ServerContext


def api_router(server: ServerContext) -> APIRouter:
    """Returns all routes of the HTTP interface."""
    router = APIRouter()
    for part in (
        cells, items, chosen_model, files, intake, jobs, live, scene, plan, drift, drilling,
        touching,
    ):  # fmt: skip
        router.include_router(part.router(server))
    return router
