"""The gate every request and every WebSocket passes before anything else sees it.

In this order: its host, its origin, its sender, its size. What leaves gets headers that keep
browsers from loading anything from, or lending anything to, another site.

A page of another site that makes its own name point at this machine (DNS rebinding) would be a
page of the same origin to the browser; only the name in ``Host`` gives it away. An address in
digits cannot be made to point elsewhere, so those are let through; of names only those stated.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robotrue.web.problems import problem
from robotrue.web.serve_settings import MB, ServeSettings
from robotrue.web.sessions import Sessions, same_secret
from robotrue.web.static_files import STATIC_ROOT

COOKIE: Final = "robotrue_session"
OPEN_PATHS: Final = frozenset({"/login", f"{STATIC_ROOT}/icon.svg"})
"""Paths that are answered before a login."""
POLICY_VIOLATION: Final = 1008
"""Why a WebSocket is closed (RFC 6455)."""
UPLOADS: Final = "/api/files"
BODY_LIMIT: Final = 2 * MB
"""Bytes of a request that is no upload."""
OPEN_BODY_LIMIT: Final = 16 * 1024
"""Bytes of a request that is answered before anybody has logged in."""
# Vue compiles its templates in the browser, hence unsafe-eval; nothing comes from another host.
POLICY: Final = (
    "default-src 'self'; script-src 'self' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; worker-src 'self' blob:; object-src 'none'; base-uri 'self'; "
    "form-action 'self'; frame-ancestors 'none'"
)
HEADERS: Final = (
    ("Content-Security-Policy", POLICY),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Referrer-Policy", "same-origin"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Permissions-Policy", "camera=(), microphone=(), geolocation=()"),
)


class BodyRefusedError(Exception):
    """A body that is longer or slower than its limit."""


class Gate:
    """An ASGI application in front of another one."""

    def __init__(self, app: ASGIApp, settings: ServeSettings, sessions: Sessions) -> None:
        self._app = app
        self._settings = settings
        self._sessions = sessions
        self._names = known_names(settings)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets a request through, or answers it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        # Reflected by the page template; there is no proxy in front of this server.
        scope["headers"] = [h for h in scope["headers"] if h[0] != b"x-forwarded-prefix"]
        refusal = self._refusal(scope, Headers(scope=scope))
        if refusal is None and scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        elif refusal is None:
            await self._through(scope, receive, self._with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        else:
            await refusal(scope, receive, self._with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        host = headers.get("host", "")
        if not host_is_known(host, self._names, loopback=self._settings.loopback):
            return problem(
                421,
                "unknown host",
                detail=f"{host[:80]!r} is not a name of this server.",
                hint="start it with --name for every name it is reached by.",
            )
        if self._is_foreign(scope, headers, host):
            return problem(403, "cross-site request", detail="sent by a page of another site.")
        if self._settings.guarded and not self._is_known(scope, headers):
            return _ask_who(scope)
        if "\0" in scope["path"] or b"%00" in scope.get("query_string", b""):
            return problem(400, "bad address", detail="it holds a NUL character.")
        length = headers.get("content-length", "0")
        if not length.isdigit():
            return problem(400, "bad content-length")
        if int(length) > self._limit(scope):
            return self._too_large(scope)
        return None

    def _is_foreign(self, scope: Scope, headers: Headers, host: str) -> bool:
        origin = headers.get("origin")
        if origin is not None and not origin_is_own(origin, host, secure=self._settings.secure):
            return True
        if headers.get("sec-fetch-site", "none") in ("none", "same-origin"):
            return False
        # A link elsewhere may open a page; it may not load, embed or send anything.
        opens = headers.get("sec-fetch-mode") == "navigate" and scope.get("method") == "GET"
        return not (opens and headers.get("sec-fetch-dest") == "document")

    def _is_known(self, scope: Scope, headers: Headers) -> bool:
        if scope["path"] in OPEN_PATHS:
            return True
        kind, _, given = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and same_secret(given.strip(), self._settings.token):
            return True
        return self._sessions.holds(session_name(headers))

    def _is_logged_out(self, scope: Scope) -> bool:
        """True if a waiting request has lost its session meanwhile."""
        if not self._settings.guarded or scope["path"] == "/logout":
            return False
        return not self._is_known(scope, Headers(scope=scope))

    def _limit(self, scope: Scope) -> int:
        if scope["path"] in OPEN_PATHS:
            return OPEN_BODY_LIMIT
        return self._settings.upload_limit if scope["path"].startswith(UPLOADS) else BODY_LIMIT

    def _too_large(self, scope: Scope) -> Response:
        limit = self._limit(scope)
        return problem(
            413,
            "too large",
            detail=f"more than {limit / MB:g} MB.",
            hint="robotrue serve --upload-mb" if scope["path"].startswith(UPLOADS) else None,
        )

    def _too_slow(self, taken: int) -> Response:
        limits = self._settings.limits
        return problem(
            408,
            "too slow",
            detail=f"{taken} bytes came, and no more within {limits.body_seconds:g} s; expected "
            f"at least {limits.body_rate / 1024:g} KB/s.",
            hint="send it again over a faster line.",
            headers={"Connection": "close"},
        )

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets a WebSocket through until its session is closed."""
        closing: list[asyncio.Task[None]] = []

        async def close() -> None:
            with contextlib.suppress(OSError, RuntimeError):  # its client was faster
                await send({"type": "websocket.close", "code": POLICY_VIOLATION})

        async def pass_on(message: Message) -> None:
            if not closing:
                await send(message)

        with self._sessions.at_end(
            session_name(Headers(scope=scope)),
            lambda: closing.append(asyncio.create_task(close())),
        ):
            await self._app(scope, receive, pass_on)

    async def _through(self, scope: Scope, receive: Receive, send: Send) -> None:
        limits, limit = self._settings.limits, self._limit(scope)
        taken, waited, more, begun = 0, 0.0, True, False
        refusal: Response | None = None
        clock = asyncio.get_running_loop().time

        async def count_body() -> Message:
            nonlocal taken, waited, more, refusal
            if not more:  # from here on the application waits for the end of the connection
                return await receive()
            since = clock()
            rest = limits.body_seconds + taken / limits.body_rate - waited
            try:
                async with asyncio.timeout(min(limits.body_seconds, max(rest, 0.0))):
                    message = await receive()
            except TimeoutError:
                refusal = self._too_slow(taken)
                raise BodyRefusedError from None
            waited += clock() - since
            taken += len(message.get("body", b""))
            more = bool(message.get("more_body", False))
            if taken > limit:
                refusal = self._too_large(scope)
                raise BodyRefusedError
            return message

        async def note_start(message: Message) -> None:
            nonlocal begun, refusal
            if not begun and refusal is None and self._is_logged_out(scope):
                refusal = _ask_who(scope)
            if refusal is None or begun:  # else the application only reports our own refusal
                begun = True
                await send(message)

        try:
            await self._app(scope, count_body, note_start)
        except BodyRefusedError:
            if begun:
                raise
        if refusal is not None and not begun:
            await refusal(scope, receive, send)

    def _with_headers(self, send: Send) -> Send:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(raw=message.setdefault("headers", []))
                for name, value in HEADERS:
                    headers.setdefault(name, value)
                headers.setdefault("Cache-Control", "no-store")
                if self._settings.secure:
                    headers.setdefault("Strict-Transport-Security", "max-age=31536000")
            await send(message)

        return send_with_headers


def session_name(headers: Headers) -> str:
    """Returns the session a request names in its cookie; empty if none."""
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _ask_who(scope: Scope) -> Response:
    if scope["type"] == "http" and scope["path"].startswith("/api"):
        return problem(
            401,
            "not logged in",
            hint="send Authorization: Bearer with the token of --token-env.",
            headers={"WWW-Authenticate": "Bearer"},
        )
    return RedirectResponse("/login", status_code=303)


def known_names(settings: ServeSettings) -> frozenset[str]:
    """Returns the host names the workbench answers to, in lower case."""
    names = {"localhost", *settings.names}
    if not settings.loopback:
        names |= {settings.host, socket.gethostname(), socket.getfqdn()}
    return frozenset(name.lower() for name in names)


def host_is_known(host: str, names: Iterable[str], *, loopback: bool) -> bool:
    """Returns whether a ``Host`` header names this server.

    Args:
        host: The header, ``name``, ``name:port`` or ``[v6]:port``.
        names: From :func:`known_names`.
        loopback: Whether the server listens to this machine alone; then so must the address be.
    """
    name = _without_port(host.strip().lower())
    if name in names:
        return True
    try:
        address = ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return address.is_loopback or not loopback


def origin_is_own(origin: str, host: str, *, secure: bool) -> bool:
    """Returns whether an ``Origin`` header is the server the request went to."""
    return origin.lower() == f"{'https' if secure else 'http'}://{host.strip().lower()}"


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]
