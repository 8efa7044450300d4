"""Pages before login: a plain login form that needs no script, and the not-found page."""

from __future__ import annotations

from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from robotrue.web.gate import COOKIE, session_name
from robotrue.web.language import Wording
from robotrue.web.preferences import Preferences, preferences_from
from robotrue.web.serve_settings import ServeSettings
from robotrue.web.sessions import LIFETIME, Sessions, Tries, client_group, same_secret
from robotrue.web.templating import render


def login_router(settings: ServeSettings, sessions: Sessions, tries: Tries) -> APIRouter:
    """Returns the routes ``/login`` and ``/logout``."""
    router = APIRouter(include_in_schema=False)

    @router.get("/login")
    async def form(request: Request) -> Response:
        if not settings.guarded:
            return RedirectResponse("/", status_code=303)
        return _page(request)

    @router.post("/login")
    async def enter(request: Request) -> Response:
        say, address = (
            reader_words(request),
            client_group(request.client.host if request.client else ""),
        )
        body = await request.body()
        # Nothing is awaited from here to the comparison: requests whose bodies come at the same
        # moment would all find the old count.
        wait = tries.wait(address)
        if wait > 0.0:
            fault = say("login.wait", seconds=int(wait) + 1)
            return _page(request, fault, status=429, headers={"Retry-After": str(int(wait) + 1)})
        tries.count(address)
        fields = parse_qs(body.decode("utf-8", errors="replace"))
        given = fields.get("secret", [""])[0]
        # Both are compared, so that the time does not reveal which of them exists.
        right = [same_secret(given, wanted) for wanted in (settings.password, settings.token)]
        if not any(right):
            return _page(request, say("login.wrong"), status=403)
        tries.uncount(address)
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(
            COOKIE,
            sessions.open(),
            max_age=int(LIFETIME),
            httponly=True,
            samesite="strict",
            secure=settings.secure,
        )
        return answer

    @router.post("/logout")
    async def leave(request: Request) -> Response:
        sessions.close(session_name(request.headers))
        answer = RedirectResponse("/login", status_code=303)
        answer.delete_cookie(COOKIE)
        return answer

    return router


def reader_words(request: Request) -> Wording:
    """Returns the texts of the client, who may not have logged in."""
    return Wording(_preferences(request).language)


def _preferences(request: Request) -> Preferences:
    return preferences_from(request.cookies, request.headers.get("accept-language", ""))


def _render_plain(request: Request, template: str, **values: object) -> str:
    theme = _preferences(request).theme
    return render(template, say=reader_words(request), theme=theme, **values)


def missing_page(request: Request) -> HTMLResponse:
    """Returns the not-found page, with the way back."""
    return HTMLResponse(_render_plain(request, "missing_page.html"), status_code=404)


def is_page(request: Request) -> bool:
    """Returns true if a person's browser requested a page, and not a script a file."""
    wants = "text/html" in request.headers.get("accept", "")
    return wants and not request.url.path.startswith(("/api", "/static", "/vendor"))


def _page(
    request: Request, fault: str = "", *, status: int = 200, headers: dict[str, str] | None = None
) -> HTMLResponse:
    page = _render_plain(request, "login.html", fault=fault)
    return HTMLResponse(page, status_code=status, headers=headers)
