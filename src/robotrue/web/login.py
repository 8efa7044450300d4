"""The login page: a plain form that needs no script."""

from __future__ import annotations

from html import escape
from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from robotrue.report.theme import STYLE
from robotrue.web.gate import COOKIE, session_name
from robotrue.web.language import Wording
from robotrue.web.preferences import preferences_from
from robotrue.web.sessions import LIFETIME, Sessions, Tries, client_group, same_secret
from robotrue.web.settings import ServeSettings

LOOK = """
main{max-width:420px;padding-top:16vh}
form{background:var(--card);border:1px solid var(--rule);border-radius:12px;padding:28px}
h1{font-size:22px;margin:0 0 18px}
label{display:block;font-size:14px;color:var(--muted);margin-bottom:6px}
input{width:100%;font:inherit;padding:12px 14px;border:1px solid var(--rule);border-radius:8px;
 background:var(--page);color:var(--ink)}
button{width:100%;min-height:48px;margin-top:18px;border:0;border-radius:8px;font:inherit;
 font-weight:600;background:var(--after);color:var(--card);cursor:pointer}
input:focus-visible,button:focus-visible{outline:3px solid var(--after);outline-offset:2px}
.fault{color:var(--bad);margin:14px 0 0}
"""


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
            _wording(request),
            client_group(request.client.host if request.client else ""),
        )
        body = await request.body()
        # Nothing is awaited from here to the comparison: requests whose bodies come at the same
        # moment would all find the count of before.
        wait = tries.wait(address)
        if wait > 0.0:
            fault = say("login.wait", seconds=int(wait) + 1)
            return _page(request, fault, status=429, headers={"Retry-After": str(int(wait) + 1)})
        tries.count(address)
        fields = parse_qs(body.decode("utf-8", errors="replace"))
        given = fields.get("secret", [""])[0]
        # Both are compared, so that the time does not tell which of them exists.
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


def _wording(request: Request) -> Wording:
    chosen = preferences_from(request.cookies, request.headers.get("accept-language", ""))
    return Wording(chosen.language)


def _page(
    request: Request, fault: str = "", *, status: int = 200, headers: dict[str, str] | None = None
) -> HTMLResponse:
    say = _wording(request)
    remark = f'<p class="fault" role="alert" data-testid="login-fault">{escape(fault)}</p>'
    return HTMLResponse(
        f'<!doctype html><html lang="{say.language}"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>robotrue</title><style>{STYLE}{LOOK}</style>"
        f'<main><form method="post" action="/login"><h1>{escape(say("login.title"))}</h1>'
        f'<label for="secret">{escape(say("login.secret"))}</label>'
        '<input id="secret" name="secret" type="password" autocomplete="current-password" '
        'autofocus required data-testid="login-secret">'
        f'<button data-testid="login-enter">{escape(say("login.enter"))}</button>'
        f"{remark if fault else ''}</form></main></html>",
        status_code=status,
        headers=headers,
    )
