"""``robotrue serve`` in a process of its own, and a browser's page that keeps what went wrong."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from web_shop import Served

WAIT = 600_000
"""ms; only what hangs takes so long, on whatever else the machine is busy with."""


@contextlib.contextmanager
def serving(folder: Path, *options: str, start: str = "", **environment: str) -> Iterator[Served]:
    """Serves a workspace on a free port; ``start`` is Python that does it otherwise."""
    usual = "from robotrue.cli.main import run; run()"
    command = [sys.executable, "-c", usual, "serve", str(folder), "--port", "0", *options]
    if start:
        command = [sys.executable, "-c", start, str(folder), *options]
    around = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **environment}
    around.pop("ROBOTRUE_DB", None)
    log = folder.parent / f"{folder.name}.log"
    with log.open("w") as told:
        process = subprocess.Popen(  # noqa: S603
            command, stderr=told, stdout=told, text=True, env=around
        )
    try:
        yield Served(address=_address(process, log), process=process, folder=folder)
    finally:
        process.terminate()
        try:
            process.wait(15.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(5.0)


def _address(process: subprocess.Popen[str], log: Path) -> str:
    until = time.monotonic() + WAIT / 1e3
    while time.monotonic() < until:
        if found := re.search(r"at (https?://\S+)/", log.read_text()):
            return found[1]
        if process.poll() is not None:
            break
        time.sleep(0.05)
    raise AssertionError(f"the server did not come up: {log.read_text()[-2000:]}")


class Watched:
    """A page that keeps what went wrong in it and whom it asked.

    A message reaches the console when the browser gets round to it, perhaps after the last
    line of the test: what a test provokes is named in ``provoked`` before, and never kept.
    """

    def __init__(self, page: Any) -> None:
        self.page, self.hosts = page, set()
        self.faults: list[str] = []
        self.provoked: tuple[str, ...] = ()
        page.set_default_timeout(WAIT)
        page.on("console", lambda m: m.type == "error" and self._keep(m.text))
        page.on("pageerror", lambda e: self._keep(str(e)))
        page.on("request", lambda r: self.hosts.add(urlsplit(r.url).netloc))

    def _keep(self, fault: str) -> None:
        if not any(words in fault for words in self.provoked):
            self.faults.append(fault)

    def find(self, mark: str) -> Any:
        return self.page.locator(f'[data-testid="{mark}"]')

    def drop(self, *paths: Path) -> None:
        self.find("file-input").set_input_files([str(path) for path in paths])


@contextlib.contextmanager
def watching(browser: Any, served: Served, **settings: Any) -> Iterator[Watched]:
    """Opens a page of a user's own; at the end nothing went wrong in it, nobody else was asked."""
    size = {"width": 1280, "height": 800}
    context = browser.new_context(base_url=served.address, **{"viewport": size, **settings})
    found = Watched(context.new_page())
    try:
        yield found
    finally:
        context.close()
    assert found.hosts <= {urlsplit(served.address).netloc, ""}
    assert not found.faults, found.faults
