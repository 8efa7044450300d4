"""Live data: sources, limits, alarms, and the frames themselves."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Annotated, Final

from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect
from fastapi.responses import Response
from pydantic import BaseModel, Field

from robotrue.web import live_sources
from robotrue.web.api.items_routes import CSV, Id, csv_file, record_document
from robotrue.web.live_relay import Viewer
from robotrue.web.live_sources import LiveSource
from robotrue.web.page_context import ServerContext
from robotrue.web.problems import missing_if_unknown

Limit = Annotated[float, Field(ge=0.0, le=1e6, allow_inf_nan=False)]
MOST: Final = 5000
"""Largest number of alarms in one answer."""


class NewSource(BaseModel, extra="forbid"):
    """A sensing service to listen to.

    Attributes:
        address: ``ws://host:port`` of ``robotrue sense --out``.
        name: For people; empty: its address.
    """

    address: Annotated[str, Field(min_length=1, max_length=200)]
    name: Annotated[str, Field(max_length=200)] = ""


class NewLimits(BaseModel, extra="forbid"):
    """Beyond these an alarm is raised, um along x, y and z of the base; 0 is none."""

    x_um: Limit
    y_um: Limit
    z_um: Limit


class Alarms(BaseModel):
    """Alarms, the newest first."""

    items: list[dict[str, object]]


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of live data."""
    routes = APIRouter(tags=["live"])
    workspace = server.workspace

    def get_source(id: str) -> LiveSource:
        with missing_if_unknown():
            return live_sources.source(workspace, id)

    @routes.post("/live/sources", status_code=201)
    async def add_source(asked: NewSource) -> dict[str, object]:
        """A sensing service that is listened to from now on."""
        record = await asyncio.to_thread(
            live_sources.add_source, workspace, asked.address, asked.name, server.settings.sense
        )
        server.relays.wake()
        return record_document(record, "document")

    @routes.put("/live/sources/{id}/limits")
    async def set_limits(id: Id, asked: NewLimits) -> dict[str, object]:
        """Other limits of a source."""
        await asyncio.to_thread(get_source, id)
        limits = (asked.x_um, asked.y_um, asked.z_um)
        record = await asyncio.to_thread(live_sources.set_limits, workspace, id, limits)
        server.relays.wake()
        return record_document(record, "document")

    @routes.get("/live/sources/{id}/alarms")
    def list_alarms(id: Id, limit: Annotated[int, Query(ge=1, le=MOST)] = 200) -> Alarms:
        """The alarms of a source, the newest first."""
        return Alarms(items=live_sources.alarms(workspace, get_source(id).id, limit=limit))

    @routes.get(
        "/live/sources/{id}/alarms.csv",
        response_class=Response,
        responses=CSV,
    )
    def download_alarms(id: Id) -> Response:
        """The alarms of a source as a table, the oldest first."""
        found = live_sources.alarms(workspace, get_source(id).id, limit=MOST)
        return csv_file(live_sources.alarms_csv(found), "alarms.csv")

    _offer_frames(routes, server)
    return routes


def _offer_frames(routes: APIRouter, server: ServerContext) -> None:
    """Adds the WebSocket of a source's frames."""

    @routes.websocket("/live/sources/{id}/frames")
    async def frames(socket: WebSocket, id: str) -> None:
        relay = server.relays.of(id)
        viewer = None if relay is None else relay.join()
        if relay is None or viewer is None:
            await socket.close(1013)  # try again later: it is not yet listened to, or too many look
            return
        await socket.accept()
        sending = asyncio.create_task(_send(socket, viewer))
        try:
            while True:
                said = await socket.receive_text()
                viewer.had(int(said) if said.isdigit() and len(said) < 4 else 0)
        except (WebSocketDisconnect, KeyError):  # a binary message has no text
            pass
        finally:
            relay.leave(viewer)
            sending.cancel()


async def _send(socket: WebSocket, viewer: Viewer) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # a viewer that disconnected
        while (frame := await viewer.take()) is not None:
            await socket.send_text(frame)
        await socket.close(1012)
