"""Errors as JSON (RFC 9457): a title, a status, what was wrong and one thing to try."""

from __future__ import annotations

from typing import Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from robotrue.errors import (
    ConfigurationError,
    FormatError,
    MissingExtraError,
    ModelMismatchError,
    RobotrueError,
)

MEDIA_TYPE: Final = "application/problem+json"
STATUS: Final[dict[type[RobotrueError], int]] = {
    ConfigurationError: 400,
    FormatError: 400,
    ModelMismatchError: 409,
    MissingExtraError: 501,
}
"""Status of an error; all others are 422: understood, and refused for what the data are."""


class MissingError(ConfigurationError):
    """Something asked for by name that is not in the workspace."""


class Problem(BaseModel):
    """What was wrong, and one thing to try (RFC 9457)."""

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
        (409, "Two things that do not belong together, or somebody else was first."),
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
    """Returns a problem document; facts that are None are left out."""
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
    """Returns the name of the file an error speaks of, without the folders of the server."""
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
