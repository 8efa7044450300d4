"""Ask for a job; a worker (`jobs run`, or the web app) does it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.job_kinds import job_kinds
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Option, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder, job_result
from robotrue.errors import ConfigurationError

JSON: Final = re.compile(r"true|false|null|-?\d+(\.\d+)?")
TEXTS: Final = frozenset(
    {"cell", "measurements", "model", "program", "registration", "name", "note"}
)
"""Parameters that are ids or names."""


class JobsSubmitRequest(Request):
    """Which job."""

    kind: Annotated[str, Option(argument="KIND", help="calibrate, compensate, plan or validate.")]
    parameter: Annotated[
        tuple[str, ...],
        Option(
            names=("--parameter", "-p"),
            help="NAME=VALUE, a text or JSON; may be repeated: then a list.",
        ),
    ] = ()
    folder: WorkspaceFolder = HERE


def run(request: JobsSubmitRequest, context: Context) -> PlainResult:
    """Queues a job.

    Raises:
        ConfigurationError: No such kind, or parameters it cannot have.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    kinds = job_kinds()
    if request.kind not in kinds:
        raise ConfigurationError(
            f"{request.kind!r} is no kind of job, expected {', '.join(kinds)}."
        )
    with Workspace.open(request.folder) as workspace:
        id = jobs.submit(workspace, request.kind, parse_parameters(request.parameter))
        job = jobs.status(workspace, id)
    context.inform(f"job {id} waits; robotrue jobs run does it")
    return job_result(job)


def parse_parameters(stated: Sequence[str]) -> dict[str, object]:
    """Returns the values of ``NAME=VALUE``; a name that is repeated has a list.

    Raises:
        ConfigurationError: Another form, or no JSON where it begins like some.
    """
    values: dict[str, list[object]] = {}
    for text in stated:
        name, equals, stated_value = text.partition("=")
        if not equals or not name:
            raise ConfigurationError(f"-p {text!r}, expected NAME=VALUE.", hint="-p cell=left")
        value = _value(name, stated_value)
        values.setdefault(name, []).append(value)
    return {name: given if len(given) > 1 else given[0] for name, given in values.items()}


def _value(name: str, text: str) -> object:
    """JSON where it is some; ids and names are text, also where they look like numbers."""
    if text[:1] in "[{" or (name not in TEXTS and JSON.fullmatch(text)):
        try:
            return json.loads(text)
        except ValueError as cause:
            raise ConfigurationError(f"-p {name}={text!r} is no JSON ({cause}).") from None
    return text


OPERATION: Final = Operation(request=JobsSubmitRequest, run=run)
