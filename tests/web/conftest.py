"""A small shop in a workspace, its HTTP interface in this process, and a server with a browser."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="needs fastapi: pip install 'robotrue[web]'")

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))
sys.path.insert(0, str(Path(__file__).parent))

from serving import serving
from web_shop import Client, Served, Shop, fill, write_files

from robotrue.store.workspace import Workspace
from robotrue.web import server
from robotrue.web.job_process import JobProcess
from robotrue.web.serve_settings import ServeSettings
from robotrue.web.workers import P, QueryWorkers, R

with warnings.catch_warnings():  # Starlette would rather have a client that few have yet
    warnings.simplefilter("ignore", DeprecationWarning)
    warnings.simplefilter("ignore", UserWarning)
    from starlette.testclient import TestClient

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-accelerated-2d-canvas",
    "--no-sandbox",
)


class InProcess(QueryWorkers):
    """Questions answered in this process: the tests would otherwise wait for imports."""

    async def ask(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        return call(*args, **kwargs)


class NoJobProcess(JobProcess):
    """Leaves jobs to the test, which does them itself and would race with a process."""

    async def watch(self) -> None:
        return None


@pytest.fixture(scope="session")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    found = fill(tmp_path_factory.mktemp("place") / "shop", files)
    with found.workspace:
        yield found


@pytest.fixture
def client(filled: Shop, monkeypatch: pytest.MonkeyPatch) -> Iterator[Client]:
    """Makes clients of the interface, of this shop or another; else settings of the server."""
    with contextlib.ExitStack() as stack:

        def make(
            host: str = "127.0.0.1",
            shop: Shop | None = None,
            workspace: Workspace | None = None,
            **settings: Any,
        ) -> TestClient:
            monkeypatch.setattr(server, "QueryWorkers", InProcess)
            monkeypatch.setattr(server, "JobProcess", NoJobProcess)
            workspace = workspace or (shop or filled).workspace
            wanted = ServeSettings(workspace=workspace.folder, host=host, **settings)
            context = server.server_context(wanted, workspace)
            base = "http://127.0.0.1" if host == "127.0.0.1" else "http://cell.example"
            made = TestClient(server.core_app(context), base_url=base)
            return stack.enter_context(made)

        yield make


@pytest.fixture(scope="session")
def kernels() -> None:
    """Machine code of the kernels on the disk, for servers whose jobs a page waits for."""
    from robotrue.app.files_context import FilesContext
    from robotrue.app.operations.warm_up import WarmUpRequest, run
    from robotrue.app.reporting import Silent

    run(WarmUpRequest(), FilesContext(Silent()))


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """``robotrue serve`` of an empty workspace on a free port."""
    with serving(tmp_path_factory.mktemp("served") / "shop") as found:
        yield found


@pytest.fixture(scope="module")  # while it is open no other test can run an event loop
def browser() -> Iterator[Any]:
    """Debian's Chromium, drawing in software."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium")
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=str(CHROMIUM), args=list(FLAGS))
        try:
            yield found
        finally:
            found.close()
