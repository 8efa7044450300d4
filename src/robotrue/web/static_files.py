"""Scripts, styles and pictures of the pages, at addresses that change with their content.

A browser keeps them without asking again, and loads all of them again after an update. Scripts
import each other by relative addresses, and so by those of the same release.
"""

from __future__ import annotations

import hashlib
import os
from importlib.metadata import version
from pathlib import Path
from typing import Final

from starlette.applications import Starlette
from starlette.responses import Response
from starlette.staticfiles import PathLike, StaticFiles
from starlette.types import Scope

OWN: Final = Path(__file__).parent / "static"
LIVE: Final = Path(__file__).parents[1] / "online" / "live"
VENDORED: Final = {"vue": "static", "three": "elements/scene/dist"}
"""Folders of the wheel of NiceGUI, of which nothing else is used: it brings Vue and Three.js."""


def hash_files(*folders: Path) -> str:
    """Returns a hash of the files in folders, and of the version of those of NiceGUI."""
    found = hashlib.sha256(version("nicegui").encode())
    for file in (path for folder in folders for path in sorted(folder.rglob("*.*"))):
        found.update(b"\0%s\0%s" % (file.name.encode(), file.read_bytes()))
    return found.hexdigest()[:16]


STAMP: Final = hash_files(OWN, LIVE)
STATIC_ROOT: Final = f"/static/{STAMP}"
"""Address of the folder that all of them are in."""


def add_static_files(app: Starlette) -> None:
    """Serves the files below :data:`STATIC_ROOT`, and at addresses of other releases unstored."""
    for name, folder in VENDORED.items():
        app.mount(f"/static/{{stamp}}/{name}", StampedFiles(packages=[("nicegui", folder)]))
    app.mount("/static/{stamp}/live", StampedFiles(directory=LIVE))
    app.mount("/static/{stamp}", StampedFiles(directory=OWN))


class StampedFiles(StaticFiles):
    """Files that a browser may keep if their address has the stamp of this release."""

    def file_response(
        self, full_path: PathLike, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Returns a file, or that it has not changed."""
        answer = super().file_response(full_path, stat_result, scope, status_code)
        if scope["path_params"]["stamp"] == STAMP:
            answer.headers["Cache-Control"] = "public, max-age=31536000, immutable"
        return answer
