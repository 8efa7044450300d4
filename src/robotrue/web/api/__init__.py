"""The HTTP interface under ``/api``: what the pages use, open to everybody's own programs."""

from __future__ import annotations

from fastapi import APIRouter

from robotrue.web.api import (
    cells,
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
from robotrue.web.bench import House


def api_router(house: House) -> APIRouter:
    """Returns all routes of the HTTP interface."""
    router = APIRouter()
    for part in (cells, items, files, intake, jobs, live, scene, plan, drift, drilling, touching):
        router.include_router(part.router(house))
    return router
