"""Refusals: as JSON (RFC 9457), and as cards on a page in the reader's language.

The error itself is worded where it is detected, below the web room, in English. A card adds the
text for a reader of another language: the kind of fault, and its general remedy. ``bench.fault`` of
``static/bench.js`` does the same for answers of the HTTP interface.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from markupsafe import Markup
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from robotrue.errors import (
    ConfigurationError,
    FormatError,
    MissingExtraError,
    ModelMismatchError,
    RobotrueError,
)
from robotrue.web.language import Wording
from robotrue.web.templating import render

MEDIA_TYPE: Final = "application/problem+json"
STATUS: Final[dict[type[RobotrueError], int]] = {
    ConfigurationError: 400,
    FormatError: 400,
    ModelMismatchError: 409,
    MissingExtraError: 501,
}
"""Status of an error; all others are 422: understood, and refused for what the data are."""
KINDS: Final = (
    "configuration error", "database down error", "format error", "implausible data error",
    "shape error", "observability error", "convergence error", "reach error",
    "model mismatch error", "step error", "archive error", "missing extra error",
    "missing error", "unanswered", "invalid request", "too large", "no connection", "other",
)  # fmt: skip
OF_COMMANDS: Final = ("--", "robotrue workspace ")
"""Beginnings of hints for the command line; the page has buttons instead."""


class MissingError(ConfigurationError):
    """Raised for a name that is not in the workspace."""


@contextmanager
def missing_if_unknown() -> Iterator[None]:
    """Raises what a block does not find as a :class:`MissingError`."""
    try:
        yield
    except ConfigurationError as cause:
        raise MissingError(cause.message, hint=cause.hint) from cause


class Problem(BaseModel):
    """An error, and one thing to try (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str = ""
    hint: str = ""
    source: str = ""
    line: int = 0


DOCUMENTED: Final[dict[int | str, dict[str, object]]] = {
    status: {
        "description": said,
        "content": {MEDIA_TYPE: {"schema": Problem.model_json_schema()}},
    }
    for status, said in (
        (400, "A file, a name or a value that cannot be used."),
        (404, "Not in this workspace."),
        (409, "Items that do not belong together, or another user saved first."),
        (413, "Larger than the limit for uploads."),
        (422, "Understood, and refused for what the data are; or a request of another form."),
        (501, "Needs an optional package that is not installed here."),
    )
}
"""What every operation of the interface may answer besides, for its description."""


def problem(
    status: int,
    title: str,
    *,
    detail: str = "",
    headers: dict[str, str] | None = None,
    **facts: object,
) -> JSONResponse:
    """Returns a problem document; facts that are None are omitted."""
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **facts}
    return JSONResponse(
        {k: v for k, v in body.items() if v is not None and v != ""},
        status_code=status,
        media_type=MEDIA_TYPE,
        headers=headers,
    )


def of_error(error: RobotrueError) -> JSONResponse:
    """Returns the problem document of an error, with its own words and fields."""
    status = 404 if isinstance(error, MissingError) else STATUS.get(type(error), 422)
    return problem(
        status,
        title_of(error),
        detail=error.message,
        hint=error.hint,
        source=source_name(error),
        line=error.line,
    )


def source_name(error: RobotrueError) -> str | None:
    """Returns the name of the file of an error, without the folders of the server."""
    return None if error.source is None else error.source.replace("\\", "/").split("/")[-1]


def title_of(error: RobotrueError) -> str:
    """Returns the kind of an error in words, e.g. ``"format error"``."""
    return kind_words(type(error).__name__)


def kind_words(name: str) -> str:
    """Returns the name of a type of error in words."""
    return "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()


def answer_with_problems(app: FastAPI) -> None:
    """Makes every refusal of the application a problem document."""

    @app.exception_handler(RobotrueError)
    async def answer_refused(request: Request, error: RobotrueError) -> JSONResponse:
        return of_error(error)

    @app.exception_handler(RequestValidationError)
    async def _invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        return problem(422, "invalid request", detail=f"{place}: {first['msg']}.")

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        headers = None if error.headers is None else dict(error.headers)
        return problem(error.status_code, str(error.detail).lower(), headers=headers)


def refusal(say: Wording, error: RobotrueError, *, title: str = "") -> Markup:
    """Returns a card with the refused request, the cause, and what to try.

    Args:
        say: The words of the reader.
        error: The raised error.
        title: Replaces the kind of error; empty: the kind.
    """
    place, file = "", source_name(error)
    if file is not None:
        line = f":{error.line}" if error.line is not None else ""
        place = f"{file}{line}: "
    return fault_card(say, title_of(error), place + error.message, error.hint, title=title)


def fault_card(
    say: Wording, kind: str, message: str, hint: str | None, *, title: str = ""
) -> Markup:
    """Returns the card of a refusal of which kind, message and hint are known.

    Args:
        say: The words of the reader.
        kind: One of :data:`KINDS`; another counts as the last.
        message: In English.
        hint: Likewise; None: there is none.
        title: In the place of the kind.
    """
    hint = None if hint is not None and hint.startswith(OF_COMMANDS) else hint
    key = f"fault.{(kind if kind in KINDS else KINDS[-1]).replace(' ', '_')}"
    return render("fault.html", say=say, title=title, key=key, message=message, hint=hint)


def fault_words(say: Wording) -> dict[str, object]:
    """Returns the texts that ``bench.fault`` needs in the browser."""
    keys = {kind: f"fault.{kind.replace(' ', '_')}" for kind in KINDS}
    return {
        "kinds": {kind: {"title": say(key), "do": say(f"{key}_do")} for kind, key in keys.items()},
        "english": say("fault.english"),
        "try": say("fault.try"),
        "plain": say.language == "en",
        "commands": OF_COMMANDS,
    }
