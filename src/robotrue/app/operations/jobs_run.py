"""Run queued jobs, each in its own process, until Ctrl-C."""

from __future__ import annotations

from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.job_kinds import job_kinds
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import count
from robotrue.app.request import Option, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder
from robotrue.store.query_defaults import SLOTS


class JobsRunRequest(Request):
    """How many at a time, and until when."""

    until_idle: Annotated[bool, Option(help="End when nothing waits.")] = False
    slots: Annotated[int, Option(help="Jobs at a time.", least=1)] = SLOTS
    dask: Annotated[
        str | None,
        Option(
            variable="ROBOTRUE_DASK", help="Address of a Dask scheduler whose workers do the jobs."
        ),
    ] = None
    folder: WorkspaceFolder = HERE


def run(request: JobsRunRequest, context: Context) -> PlainResult:
    """Does jobs until Ctrl-C, or until nothing waits; returns the number of attempts."""
    import signal
    from threading import Event

    from robotrue.store.jobs_worker import run_worker

    stopped = Event()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: stopped.set())
    context.inform("working; Ctrl-C stops, and what is under way is begun anew by the next worker")
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


OPERATION: Final = Operation(request=JobsRunRequest, run=run, is_service=True)
