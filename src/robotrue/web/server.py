"""The workbench, one process on one port: pages, HTTP interface, static files, behind the gate."""

from __future__ import annotations

import asyncio
import gc
import logging
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import uvicorn
from fastapi import FastAPI, Request, Response
from nicegui import Client, ui
from nicegui import app as pages
from starlette.staticfiles import StaticFiles

from robotrue import __version__
from robotrue.errors import ConfigurationError
from robotrue.report.theme import DARK, LIGHT
from robotrue.store.workspace import Workspace
from robotrue.web.answers import Answers
from robotrue.web.api import api_router
from robotrue.web.bench import Bench, House, Page
from robotrue.web.front import FrontServer, front, with_descriptors
from robotrue.web.gate import Gate
from robotrue.web.job_process import JobProcess
from robotrue.web.language import Wording
from robotrue.web.live_relay import Relays
from robotrue.web.login import login_router
from robotrue.web.missing_page import is_page, missing_page
from robotrue.web.models import shown_model
from robotrue.web.pages import PAGES
from robotrue.web.parts.frame import frame
from robotrue.web.parts.live import FILES as LIVE_FILES
from robotrue.web.preferences import preferences_from
from robotrue.web.problems import DOCUMENTED, answer_with_problems
from robotrue.web.reports import reports_router
from robotrue.web.sessions import Sessions, Tries
from robotrue.web.settings import ServeSettings
from robotrue.web.uploads import forget_old
from robotrue.web.workers import Workers

STATIC: Final = Path(__file__).parent / "static"
FEWEST_SECONDS: Final = 10.0
"""Time a page may take to be built before the browser is told so."""


def serve(settings: ServeSettings, *, ready: Callable[[str], None]) -> None:
    """Serves a workspace until the process is told to end.

    Args:
        settings: Where and to whom.
        ready: Told the address once the port is taken.

    Raises:
        ConfigurationError: The port is taken or not allowed, or the workspace cannot be opened.
    """
    limits = with_descriptors(settings.limits)
    bound = listening(settings)
    port = bound.getsockname()[1]
    with open_workspace(settings.workspace) as workspace:
        house = house_of(settings, workspace)
        app = with_pages(core_app(house), house)
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
        gc.freeze()  # all of it stays: nobody need go through it again
        shown = f"[{settings.host}]" if ":" in settings.host else settings.host
        ready(f"{'https' if settings.secure else 'http'}://{shown}:{port}/")
        FrontServer(config, limits).run(sockets=[bound])


def house_of(settings: ServeSettings, workspace: Workspace) -> House:
    """Returns what pages and interface share, with nothing started yet."""
    workers = Workers()
    return House(
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
    """Returns a socket that listens on the address asked for.

    Raises:
        ConfigurationError: Another process has the port, or the address is not of this machine.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((settings.host, settings.port))
        bound.listen(128)  # whoever comes before the pages stand waits, and is not refused
    except OSError as cause:
        bound.close()
        raise ConfigurationError(
            f"cannot listen on {settings.host} port {settings.port}: {cause.strerror}.",
            hint="another --port; 0 takes a free one.",
        ) from cause
    return bound


def core_app(house: House) -> FastAPI:
    """Returns the application without its pages: login, HTTP interface, static files."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        await asyncio.to_thread(forget_old, house.workspace)
        watching = [asyncio.create_task(each.watch()) for each in (house.job_process, house.relays)]
        yield
        for each in watching:
            each.cancel()
        await asyncio.gather(*watching, return_exceptions=True)
        house.job_process.stop()
        house.workers.stop()

    app = FastAPI(
        title="robotrue",
        version=__version__,
        description="The workbench's HTTP interface. Lengths in JSON carry their unit in the name.",
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
    )
    sessions = Sessions()
    answer_with_problems(app)
    app.include_router(login_router(house.settings, sessions, Tries()))
    app.include_router(reports_router(house))
    app.include_router(api_router(house), prefix="/api", responses=DOCUMENTED)
    app.mount(LIVE_FILES, StaticFiles(packages=[("robotrue.online", "live")]))
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    app.add_middleware(Gate, settings=house.settings, sessions=sessions)
    return app


def with_pages(app: FastAPI, house: House) -> FastAPI:
    """Returns the application with its pages; once per process, NiceGUI knows only one."""
    logging.getLogger("nicegui").setLevel(logging.ERROR)
    Client.shared_head_html += (
        f"<style>{_palette()}</style>"
        f'<link rel="stylesheet" href="/static/bench.css?v={__version__}">'
        f'<script src="/static/bench.js?v={__version__}"></script>'
    )
    for page in PAGES:
        _register(page, house)
    ui.run_with(
        app,
        title="robotrue",
        favicon=STATIC / "icon.svg",
        tailwind=False,
        show_welcome_message=False,
        binding_refresh_interval=None,
        reconnect_timeout=10.0,
    )
    usual = pages.exception_handlers[404]

    @pages.exception_handler(404)
    async def missing(request: Request, error: Exception) -> Response:
        if is_page(request):
            return missing_page(request)
        answer: Response = await usual(request, error)  # type: ignore[misc]
        return answer

    return app


def _register(page: Page, house: House) -> None:
    @ui.page(page.path, response_timeout=FEWEST_SECONDS)
    async def show(request: Request) -> None:
        view = preferences_from(request.cookies, request.headers.get("accept-language", ""))
        query = dict(request.query_params)
        shown = await shown_model(house.workspace, query.get("model"))
        bench = Bench(
            house=house,
            view=view,
            say=Wording(view.language),
            query=query,
            model=shown.model,
            chosen=shown.chosen,
            models=shown.offered,
        )
        ui.page_title(f"{bench.say(f'nav.{page.name}')} · robotrue")
        with frame(bench, page, PAGES):
            await page.build(bench)


def _palette() -> str:
    """The reports' colours, for the light or dark that was chosen."""

    def variables(colours: dict[str, str]) -> str:
        return "".join(f"--{name}:{value};" for name, value in colours.items())

    return (
        f":root{{color-scheme:light;{variables(LIGHT)}}}"
        f":root[data-theme=dark]{{color-scheme:dark;{variables(DARK)}}}"
    )
