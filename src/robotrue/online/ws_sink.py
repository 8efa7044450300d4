"""Estimates to browsers: a WebSocket and the live page on one port, loopback by default.

Each viewer has its own queue: one that is slow or asleep loses its oldest frames, which are
counted, and delays neither the others nor the service.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import logging
import socket
from dataclasses import replace
from typing import Final
from urllib.parse import urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from robotrue.errors import ConfigurationError
from robotrue.online.estimates import MOST_PER_SECOND, Envelopes, EstimateBin, EstimateBlock
from robotrue.online.link import Health
from robotrue.online.live_page import (
    HEADERS,
    estimates_frame,
    health_frame,
    hello_frame,
    page_files,
)
from robotrue.online.net_address import NetAddress
from robotrue.online.queues import LatestQueue
from robotrue.online.sinks import DisplaySink, SinkSettings
from robotrue.online.ws_door import door

FRAMES: Final = "/frames"
"""Path of the WebSocket; every other path is the page."""
_PER_SECOND: Final = 50.0
_OPTIONS: Final = {
    "rate": f"frames per second, 1 to {MOST_PER_SECOND:g}",
    "origin": "https://host of another page that may connect",
    "token": "of every viewer",
}
_MOST_VIEWERS: Final = 32
_QUEUE_S: Final = 2.0
"""s of frames kept for a viewer that does not read."""
_SEND_BUFFER: Final = 1 << 16
"""Bytes the system may hold for a viewer: more of it would be shown late instead of left out."""
_LOGGER: Final = logging.getLogger("robotrue.online.ws")


class WebSocketSink(DisplaySink):
    """A server of frames (:mod:`robotrue.online.live_page`) and of the page that draws them."""

    def __init__(self, address: NetAddress, settings: SinkSettings) -> None:
        """Takes ``ws://host:port?rate=50&origin=https://host``; port 0 is a free one.

        Raises:
            ConfigurationError: An invalid rate, or no token where one is needed.
        """
        super().__init__(address, settings, beat=0.1)
        options = address.read_options(_OPTIONS)
        self._door = door(address, settings.environment)
        self._rate = options.number(
            "rate", "Hz", default=_PER_SECOND, low=1.0, high=MOST_PER_SECOND
        )
        self._envelopes = Envelopes(per_second=self._rate, joints=settings.joints)
        self._files = page_files()
        self._viewers: set[LatestQueue[str]] = set()
        self._server: Server | None = None
        self._beats: asyncio.Task[None] | None = None
        self._joined = 0

    @property
    def port(self) -> int:
        """The port it listens at, 0 before it is open."""
        return 0 if self._server is None else int(self._server.sockets[0].getsockname()[1])

    async def open(self) -> None:
        """Begins to listen.

        Raises:
            ConfigurationError: The port is taken, or the host is not this computer.
        """
        _LOGGER.setLevel(logging.CRITICAL)  # a browser that goes away is no error of ours
        try:
            self._server = await serve(
                self._viewer,
                self._address.host,
                self._address.port,
                process_request=self._answer,
                compression=None,
                server_header=None,
                max_size=1024,
                max_queue=4,
                ping_interval=5.0,
                ping_timeout=10.0,
                close_timeout=1.0,
                logger=_LOGGER,
            )
        except OSError as cause:
            raise ConfigurationError(
                f"cannot listen at {self._address.shown}: {cause.strerror}.",
                hint="another port, or the process that holds this one.",
            ) from cause
        self._beats = asyncio.create_task(self._beat())

    def _take(self, estimates: EstimateBlock) -> None:
        self._give(self._envelopes.add(estimates))

    def _rest(self, beats: int) -> None:
        self._give(self._envelopes.flush())

    def _give(self, bins: list[EstimateBin]) -> None:
        if bins and self._viewers:
            frame = estimates_frame(bins[-int(self._rate * _QUEUE_S) :])
            for viewer in self._viewers:
                viewer.put(frame)

    async def _show_health(self) -> None:
        healths = tuple(self._settings.healths())
        for viewer in self._viewers:
            viewer.put(health_frame(healths, dropped=viewer.dropped))

    async def _viewer(self, connection: ServerConnection) -> None:
        waiting: LatestQueue[str] = LatestQueue(int(self._rate * _QUEUE_S))
        raw = connection.transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        waiting.put(hello_frame(self._settings, per_second=self._rate))
        waiting.put(health_frame(tuple(self._settings.healths()), dropped=0))
        self._viewers.add(waiting)
        self._joined += 1
        try:
            while (frame := await waiting.take()) is not None:
                await connection.send(frame)
        except ConnectionClosed:
            pass
        finally:
            self._viewers.discard(waiting)
            self._health.dropped += waiting.dropped

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Returns what is sent instead of a WebSocket, or None to go on to one."""
        headers = request.headers
        path = urlsplit(request.path).path
        if path != FRAMES:
            return self._page(path)
        refusal = self._door.refusal(
            request.path,
            _one(headers, "Host"),
            _one(headers, "Origin"),
            _one(headers, "Authorization") or "",
        )
        if refusal:
            self._health.refuse(refusal)
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{refusal}\n")
        if len(self._viewers) >= _MOST_VIEWERS:
            self._health.refuse(f"more than {_MOST_VIEWERS} viewers")
            return connection.respond(
                http.HTTPStatus.SERVICE_UNAVAILABLE, f"{self._health.last_fault}\n"
            )
        return None

    def _page(self, path: str) -> Response:
        file = self._files.get(path)
        status = http.HTTPStatus.NOT_FOUND if file is None else http.HTTPStatus.OK
        body = b"not here\n" if file is None else file.body
        headers = Headers(HEADERS)
        headers["Content-Type"] = "text/plain" if file is None else file.kind
        headers["Content-Length"] = str(len(body))
        headers["Connection"] = "close"
        return Response(status.value, status.phrase, headers, body)

    async def close(self) -> None:
        """Lets the viewers go and frees the port."""
        if self._beats is not None:
            self._beats.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._beats
        self._give(self._envelopes.flush())
        for viewer in self._viewers:
            viewer.close()
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()
            self._server = None

    def health(self) -> Health:
        """Returns the counters; connected while there are viewers, dropped counts frames."""
        return replace(
            self._health,
            connected=bool(self._viewers),
            dropped=self._health.dropped + sum(v.dropped for v in self._viewers),
            reconnects=max(0, self._joined - 1),
        )


def _one(headers: Headers, name: str) -> str | None:
    """Returns a header; a header that occurs twice counts as wrong."""
    values = headers.get_all(name)
    return None if not values else values[0] if len(values) == 1 else "\n".join(values)
