"""Jobs of a workspace: queued, listed, shown, run, cancelled."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Final, TypeAlias

from robotrue.app.context import Context
from robotrue.app.job_files import BLOCKS
from robotrue.app.job_kinds import job_kinds
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, PlainResult, Table, count, time_text
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import HERE, WorkspaceFolder
from robotrue.core.provenance import Provenance, simulation_mark
from robotrue.errors import ConfigurationError
from robotrue.store.query_defaults import LIMIT, SLOTS

if TYPE_CHECKING:
    from robotrue.store.jobs import Job


JobWord: TypeAlias = Annotated[str, Option(argument="JOB", help="Id, or its first characters.")]
JSON: Final = re.compile(r"true|false|null|-?\d+(\.\d+)?")
TEXTS: Final = frozenset(
    {"cell", "measurements", "model", "program", "registration", "name", "note"}
)
"""Parameters that are ids or names."""


class JobsSubmitRequest(Request):
    """Job to queue."""

    kind: Annotated[str, Option(argument="KIND")]
    """Kind of job: calibrate, compensate, plan, ...; a wrong one lists all."""
    parameter: Annotated[tuple[str, ...], Option(names=("--parameter", "-p"))] = ()
    """NAME=VALUE, a text or JSON; may be repeated: then a list."""
    folder: WorkspaceFolder = HERE


@operation("jobs_submit")
def submit_job(request: JobsSubmitRequest, context: Context) -> PlainResult:
    """Queue a job; a worker (`jobs run`, or the workbench) runs it.

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
    context.inform(f"job {id} is queued; robotrue jobs run processes it")
    return _job_result(job)


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
        value = _parameter_value(name, stated_value)
        values.setdefault(name, []).append(value)
    return {name: given if len(given) > 1 else given[0] for name, given in values.items()}


def _parameter_value(name: str, text: str) -> object:
    """JSON where it is some; ids and names are text, also where they look like numbers."""
    if text[:1] in "[{" or (name not in TEXTS and JSON.fullmatch(text)):
        try:
            return json.loads(text)
        except ValueError as cause:
            raise ConfigurationError(f"-p {name}={text!r} is no JSON ({cause}).") from None
    return text


class JobsListRequest(Request):
    """State of the jobs to list."""

    state: str | None = None
    """queued, running, done, failed or cancelled."""
    limit: int = LIMIT
    """Jobs shown, the newest first."""
    folder: WorkspaceFolder = HERE


@operation("jobs_list")
def list_jobs(request: JobsListRequest, context: Context) -> PlainResult:
    """List the jobs with their progress.

    Raises:
        ConfigurationError: No such state.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        page = jobs.search(workspace, state=request.state, limit=request.limit)
    return PlainResult(
        values={"total": page.total, "jobs": [_job_document(job) for job in page.items]},
        shown=(
            Table(
                title=count(page.total, "job"),
                columns=("id", "kind", "state", "done", "attempts", "submitted", "", ""),
                rows=tuple(_job_row(job) for job in page.items),
                words=True,
            ),
        ),
    )


def _job_row(job: Job) -> tuple[str, ...]:

    return (
        job.id[:8],
        job.kind,
        job.state,
        f"{job.progress:.0%}",
        str(job.attempts),
        time_text(job.submitted),
        job.text if job.error is None else str(job.error["message"]),
        simulation_mark(_is_simulated(job)),
    )


class JobsShowRequest(Request):
    """Job to show."""

    job: JobWord
    folder: WorkspaceFolder = HERE


@operation("jobs_show")
def show_job(request: JobsShowRequest, context: Context) -> PlainResult:
    """Show one job: parameters, remarks, result or error.

    Raises:
        ConfigurationError: No such job.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        job = jobs.status(workspace, request.job)
    return _job_result(job, Facts(title=f"job {job.kind}", rows=_job_facts(job)))


def _job_facts(job: Job) -> tuple[tuple[str, str], ...]:
    found = {n: v for n, v in (job.result or {}).items() if n != BLOCKS}
    error = {n: str(v) for n, v in (job.error or {}).items() if v and n != "trace"}
    return (
        ("id", job.id),
        ("state", f"{job.state}, {job.progress:.0%}, attempt {job.attempts}"),
        ("submitted", time_text(job.submitted)),
        ("finished", time_text(job.finished)),
        *_json_facts(job.parameters),
        *_json_facts(found, "result: "),
        *((f"error: {name}", text) for name, text in error.items()),
        *(("remark", remark) for remark in job.remarks),
    )


class JobsCancelRequest(Request):
    """Job to cancel."""

    job: JobWord
    folder: WorkspaceFolder = HERE


@operation("jobs_cancel")
def cancel_job(request: JobsCancelRequest, context: Context) -> PlainResult:
    """Cancel a job and discard its results.

    Raises:
        ConfigurationError: No such job.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        job = jobs.cancel(workspace, request.job)
    context.inform(f"job {job.id} is {job.state}" + ("" if job.over else " and will be cancelled"))
    return _job_result(job)


class JobsRunRequest(Request):
    """Number of parallel jobs, and when to stop."""

    until_idle: bool = False
    """End when no job is queued."""
    slots: Annotated[int, Option(least=1)] = SLOTS
    """Number of jobs at a time."""
    dask: Annotated[str | None, Option(variable="ROBOTRUE_DASK")] = None
    """Address of a Dask scheduler whose workers run the jobs."""
    folder: WorkspaceFolder = HERE


@operation("jobs_run", is_service=True)
def run_jobs(request: JobsRunRequest, context: Context) -> PlainResult:
    """Run queued jobs, each in its own process, until Ctrl-C."""
    import signal
    from threading import Event

    from robotrue.store.jobs_worker import run_worker

    stopped = Event()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: stopped.set())
    context.inform("working; Ctrl-C stops, and the next worker restarts unfinished jobs")
    attempts = run_worker(
        request.folder,
        kinds=job_kinds(),
        slots=request.slots,
        until_idle=request.until_idle,
        stop=stopped.is_set,
        dask=request.dask,
    )
    context.inform(f"{count(attempts, 'attempt')} made")
    return PlainResult(values={"attempts": attempts})


def _job_result(job: Job, *shown: Block) -> PlainResult:
    """A job as a result."""
    origin = Provenance(simulated=_is_simulated(job))
    return PlainResult(values=_job_document(job), shown=shown, provenance=origin)


def _job_document(job: Job) -> dict[str, object]:
    """A job as JSON values."""
    values = asdict(job)
    for name in ("submitted", "started", "finished"):
        time = values[name]
        values[name] = None if time is None else time.isoformat()
    return {"simulated": _is_simulated(job), **values}


def _is_simulated(job: Job) -> bool:
    """True if the result of a finished job states that it is simulated."""
    return bool((job.result or {}).get("simulated"))


def _json_facts(values: Mapping[str, object], prefix: str = "") -> tuple[tuple[str, str], ...]:
    """Names and values as JSON text."""
    return tuple((f"{prefix}{name}", json.dumps(value)) for name, value in values.items())
