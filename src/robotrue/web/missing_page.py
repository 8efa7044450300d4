"""What an address says at which there is no page: so much, and the way back."""

from __future__ import annotations

from html import escape

from fastapi import Request
from fastapi.responses import HTMLResponse

from robotrue.report.theme import STYLE
from robotrue.web.language import Wording
from robotrue.web.preferences import preferences_from

LOOK = "main{max-width:420px;padding-top:16vh}h1{font-size:22px;margin:0 0 18px}"


def missing_page(request: Request) -> HTMLResponse:
    """Returns the page, in the reader's language."""
    chosen = preferences_from(request.cookies, request.headers.get("accept-language", ""))
    say = Wording(chosen.language)
    return HTMLResponse(
        f'<!doctype html><html lang="{say.language}"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>robotrue</title><style>{STYLE}{LOOK}</style><main>"
        f'<h1>{escape(say("frame.not_found"))}</h1><p><a href="/" data-testid="home">'
        f"{escape(say('nav.cell'))}</a> · <a href='/history'>{escape(say('nav.history'))}</a></p>"
        "</main></html>",
        status_code=404,
    )


def is_page(request: Request) -> bool:
    """Returns whether a person's browser asked for a page, and not a script for a file."""
    wants = "text/html" in request.headers.get("accept", "")
    return wants and not request.url.path.startswith(("/_nicegui", "/api", "/static"))
