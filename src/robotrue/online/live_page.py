"""The live page as bytes: one page, its style and its scripts, nothing from any other host."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Final

_KINDS: Final = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
_FILES: Final = (
    "live.html", "page.css", "live.css", "page.js", "live.js", "plot.js", "history.js", "words.js",
)  # fmt: skip
HEADERS: Final = (
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-cache"),
)
"""Sent with every file: no script but ours is run, a token in an address goes nowhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFile:
    """A file of the page.

    Attributes:
        kind: Its media type.
        body: Its bytes.
    """

    kind: str
    body: bytes


def page_files() -> dict[str, PageFile]:
    """Returns every file of the page by the path it is asked for, ``/`` among them."""
    folder = _folder()
    found = {
        f"/{name}": PageFile(
            kind=f"{_KINDS[name.rpartition('.')[2]]}; charset=utf-8",
            body=(folder / name).read_bytes(),
        )
        for name in _FILES
    }
    return {"/": found["/live.html"], **found}


def view_markup() -> str:
    """Returns the view alone as HTML, for a page that has its own things around it."""
    page = (_folder() / "live.html").read_text(encoding="utf-8")
    view = page.partition('<div class="live">')[2].partition("</footer>")[0]
    return f"{view}</footer>"


def _folder() -> Traversable:
    return resources.files("robotrue.online") / "live"
