"""The HTTP interface under ``/api``: what the pages use, open to everybody's own programs."""

from __future__ import annotations

from fastapi import APIRouter

from robotrue.web.api import (
    cells_routes,
    drilling_routes,
    items_routes,
    jobs_routes,
    live_routes,
    scene_routes,
    touching_routes,
    upload_routes,
)
from robotrue.web.page_context import ServerContext


def api_router(server: ServerContext) -> APIRouter:
    """Returns all routes of the HTTP interface."""
    router = APIRouter()
    for part in (
        cells_routes, items_routes, upload_routes, jobs_routes, live_routes, scene_routes,
        drilling_routes, touching_routes,
    ):  # fmt: skip
        router.include_router(part.router(server))
    return router
