"""The HTTP protocol in front of the application: limits on request heads and on connections.

The parser joins the pieces of a header line without any limit, and the ASGI server waits for the
end of a head for as long as a client likes. Both are limited here, before anybody has logged in.
"""

from __future__ import annotations

import asyncio
import functools
import socket
from typing import Any, Final, cast

import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from robotrue.web.serve_settings import Limits
from robotrue.web.sessions import client_group

SPARE_DESCRIPTORS: Final = 128
"""For files, databases and processes."""
WANTED_DESCRIPTORS: Final = 4096
_REFUSAL: Final = (
    b"HTTP/1.1 431 Request Header Fields Too Large\r\n"
    b"content-type: text/plain; charset=utf-8\r\ncontent-length: 23\r\nconnection: close\r\n\r\n"
    b"request head too large\n"
)


class Admission:
    """Decides which connections stay when there are too many.

    The oldest connection that has not sent a whole request head goes first, so a flood of half-open
    connections does not keep out a client that sends its request.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._half_open: dict[FrontProtocol, str] = {}

    def admit(self, protocol: FrontProtocol) -> None:
        """Adds a new connection, and drops one where its address or the server has too many."""
        group = _group_of(protocol)
        self._half_open[protocol] = group
        connected = [each for each in protocol.connections if not each.transport.is_closing()]
        of_group = sum(_group_of(each) == group for each in connected)
        if of_group > self.limits.per_address:
            self._drop(next(each for each, of in self._half_open.items() if of == group))
        elif len(connected) > self.limits.connections:
            self._drop(next(iter(self._half_open)))

    def settle(self, protocol: FrontProtocol) -> None:
        """Notes that a connection has sent its first head, or has ended."""
        self._half_open.pop(protocol, None)

    def _drop(self, protocol: FrontProtocol) -> None:
        self.settle(protocol)
        protocol.transport.abort()


class FrontProtocol(HttpToolsProtocol):
    """HTTP/1.1 with a limit on the size of a request head and on the time until it is whole."""

    def __init__(
        self,
        config: uvicorn.Config,
        server_state: ServerState,
        app_state: dict[str, object],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        admission: Admission,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._admission = admission
        self._deadline: asyncio.TimerHandle | None = None
        self._unparsed = 0
        """Bytes since the parser last completed a head, a piece of a body, or a request."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Starts the time of the first head."""
        super().connection_made(transport)
        self._start_deadline()
        self._admission.admit(self)

    def data_received(self, data: bytes) -> None:
        """Parses; refuses a head, or a trailer of a body, beyond the limit."""
        if self._deadline is None and (self.cycle is None or self.cycle.response_complete):
            self._start_deadline()
        self._unparsed += len(data)
        super().data_received(data)
        if self._unparsed > self._admission.limits.head_bytes:
            if not self.transport.is_closing():
                if self.cycle is None or self.cycle.response_complete:
                    self.transport.write(_REFUSAL)
                self.transport.close()

    def on_headers_complete(self) -> None:
        """Ends the time of the head."""
        self._note_progress()
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Passes a piece of a body on."""
        self._unparsed = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Ends a request."""
        self._note_progress()
        super().on_message_complete()

    def handle_websocket_upgrade(self) -> None:
        """Hands the connection over; its WebSocket has separate limits."""
        self._note_progress()
        super().handle_websocket_upgrade()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the connection."""
        self._note_progress()
        super().connection_lost(exc)

    def _note_progress(self) -> None:
        self._unparsed = 0
        self._admission.settle(self)
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _start_deadline(self) -> None:
        seconds = self._admission.limits.head_seconds
        self._deadline = self.loop.call_later(seconds, self.transport.abort)


class FrontServer(uvicorn.Server):
    """A server whose TLS handshakes have the time of a request head."""

    def __init__(self, config: uvicorn.Config, limits: Limits) -> None:
        super().__init__(config)
        self._limits = limits

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begins to listen."""
        if self.config.is_ssl:
            loop: Any = asyncio.get_running_loop()
            loop.create_server = functools.partial(
                loop.create_server, ssl_handshake_timeout=self._limits.head_seconds
            )
        await super().startup(sockets)


def _group_of(protocol: Any) -> str:
    return client_group(protocol.client[0]) if protocol.client else ""


def front(limits: Limits) -> type[asyncio.Protocol]:
    """Returns the protocol class for ``uvicorn.Config(http=...)``, one for all connections."""
    made = functools.partial(FrontProtocol, admission=Admission(limits))
    return cast(type[asyncio.Protocol], made)  # uvicorn calls it, and types a class


def with_descriptors(limits: Limits) -> Limits:
    """Returns limits that leave descriptors free; raises the soft limit of the process first."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return limits
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    if soft == resource.RLIM_INFINITY:
        return limits
    return limits.at_most(max(soft - SPARE_DESCRIPTORS, 16))
