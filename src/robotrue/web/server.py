"""The workbench, one process on one port: pages, HTTP interface, static files, behind the gate."""

from __future__ import annotations

import asyncio
import gc
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import uvicorn
from fastapi import FastAPI, Request, Response
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException
from starlette.routing import BaseRoute
from starlette.types import Lifespan, Receive, Scope, Send

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.store.workspace import Workspace
from robotrue.version import __version__
from robotrue.web.front import FrontServer, front, with_descriptors
from robotrue.web.gate import Gate
from robotrue.web.job_process import JobProcess
from robotrue.web.language import Wording
from robotrue.web.live_relay import Relays
from robotrue.web.login import is_page, login_router, missing_page
from robotrue.web.models import shown_model
from robotrue.web.page_context import PageContext, Screen, ServerContext
from robotrue.web.pages import SCREENS
from robotrue.web.pages.overview_screen import count_items
from robotrue.web.preferences import preferences_from
from robotrue.web.problems import DOCUMENTED, answer_with_problems, refusal
from robotrue.web.serve_settings import ServeSettings
from robotrue.web.sessions import Sessions, Tries
from robotrue.web.static_files import add_static_files
from robotrue.web.uploads import forget_old
from robotrue.web.workers import Answers, QueryWorkers

INTERFACE: Final = ("/api/", "/reports/")
"""What the addresses of the HTTP interface begin with."""


def serve(settings: ServeSettings, *, ready: Callable[[str], None]) -> None:
    """Serves a workspace until the process is stopped.

    Args:
        settings: Addresses and access.
        ready: Called with the address once the port is bound.

    Raises:
        ConfigurationError: The port is taken or not allowed, or the workspace cannot be opened.
    """
    limits = with_descriptors(settings.limits)
    bound = listening(settings)
    port = bound.getsockname()[1]
    with open_workspace(settings.workspace) as workspace:
        server = server_context(settings, workspace)
        app = core_app(server)
        config = uvicorn.Config(
            app,
            http=front(limits),
            log_level="warning",
            access_log=False,
            proxy_headers=False,
            server_header=False,
            date_header=True,
            ssl_certfile=settings.certificate,
            ssl_keyfile=settings.key,
            ws_max_size=4 * 1024 * 1024,
            timeout_graceful_shutdown=3,
        )
        gc.freeze()  # all of it stays: no need to scan it again
        gc.enable()
        shown = f"[{settings.host}]" if ":" in settings.host else settings.host
        ready(f"{'https' if settings.secure else 'http'}://{shown}:{port}/")
        FrontServer(config, limits).run(sockets=[bound])


def server_context(settings: ServeSettings, workspace: Workspace) -> ServerContext:
    """Returns what pages and interface share, with nothing started yet."""
    workers = QueryWorkers()
    return ServerContext(
        settings=settings,
        workspace=workspace,
        workers=workers,
        answers=Answers(workers),
        job_process=JobProcess(workspace, settings.kinds),
        relays=Relays(workspace, settings.sense),
    )


def open_workspace(folder: Path) -> Workspace:
    """Returns the workspace in a folder; a folder that is new or empty becomes one.

    Raises:
        ConfigurationError: The folder holds something else.
    """
    if folder.is_dir() and any(folder.iterdir()):
        return Workspace.open(folder)
    return Workspace.create(folder)


def listening(settings: ServeSettings) -> socket.socket:
    """Returns a socket that listens on the requested address.

    Raises:
        ConfigurationError: Another process has the port, or the address is not of this machine.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((settings.host, settings.port))
        bound.listen(128)  # an early client waits, and is not refused
    except OSError as cause:
        bound.close()
        raise ConfigurationError(
            f"cannot listen on {settings.host} port {settings.port}: {cause.strerror}.",
            hint="another --port; 0 takes a free one.",
        ) from cause
    return bound


class Application(FastAPI):
    """The workbench; its HTTP interface is made on its first request.

    The first page would otherwise wait for the models of all requests and answers.
    """

    def __init__(self, server: ServerContext, lifespan: Lifespan[FastAPI]) -> None:
        super().__init__(
            title="robotrue",
            version=__version__,
            description="The workbench's HTTP interface. Lengths in JSON carry their unit in the "
            "name.",
            openapi_url="/api/openapi.json",
            docs_url=None,
            redoc_url=None,
            lifespan=lifespan,
        )
        self._without_interface: ServerContext | None = server

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers a request."""
        if scope["type"] != "lifespan" and scope["path"].startswith(INTERFACE):
            self._add_interface()
        await super().__call__(scope, receive, send)

    @property
    def routes(self) -> list[BaseRoute]:
        """Every route, those of the HTTP interface, too."""
        self._add_interface()
        return super().routes

    def _add_interface(self) -> None:
        server, self._without_interface = self._without_interface, None
        if server is not None:
            from robotrue.web.api import api_router
            from robotrue.web.api.items_routes import reports_router

            self.include_router(reports_router(server))
            self.include_router(api_router(server), prefix="/api", responses=DOCUMENTED)


def core_app(server: ServerContext) -> FastAPI:
    """Returns the application: login, HTTP interface, static files, pages."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        await asyncio.to_thread(forget_old, server.workspace)
        watching = [
            asyncio.create_task(each.watch()) for each in (server.job_process, server.relays)
        ]
        yield
        for each in watching:
            each.cancel()
        await asyncio.gather(*watching, return_exceptions=True)
        server.job_process.stop()
        server.workers.stop()

    app = Application(server, lifespan)
    sessions = Sessions()
    answer_with_problems(app)
    app.include_router(login_router(server.settings, sessions, Tries()))
    add_static_files(app)
    _add_pages(app, server)
    app.add_middleware(Gate, settings=server.settings, sessions=sessions)
    return app


def _add_pages(app: FastAPI, server: ServerContext) -> None:
    """Adds the pages, and the page of an address that has none."""
    for screen in SCREENS:
        _add_page(app, server, screen)
    usual = app.exception_handlers[HTTPException]

    @app.exception_handler(404)
    async def missing(request: Request, error: Exception) -> Response:
        if is_page(request):
            return missing_page(request)
        answer: Response = await usual(request, error)  # type: ignore[misc]
        return answer


def _add_page(app: FastAPI, server: ServerContext, screen: Screen) -> None:
    async def show(request: Request) -> HTMLResponse:
        view = preferences_from(request.cookies, request.headers.get("accept-language", ""))
        query = {**request.query_params, **request.path_params}
        part = query.pop("part", "")
        shown = await shown_model(server.workspace, query.get("model"))
        context = PageContext(
            server=server,
            screen=screen,
            screens=SCREENS,
            view=view,
            say=Wording(view.language),
            query=query,
            model=shown.model,
            in_use=shown.in_use,
            models=shown.offered,
            stages=await asyncio.to_thread(count_items, server.workspace),
        )
        return HTMLResponse(await _build_page(context, part if part in screen.builds else ""))

    for path in filter(None, (screen.path, screen.below)):
        app.add_route(path, show, include_in_schema=False)


async def _build_page(context: PageContext, part: str) -> str:
    """Builds a page or a part of it; a missing item gets a not-found card."""
    try:
        return await context.screen.builds[part](context)
    except RobotrueError as error:
        if part:
            return refusal(context.say, error)
        title = context.say("frame.not_found") if isinstance(error, ConfigurationError) else ""
        return context.render("refused.html", card=refusal(context.say, error, title=title))
