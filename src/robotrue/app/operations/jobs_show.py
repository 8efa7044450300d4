"""Show one job: parameters, remarks, result or error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts
from robotrue.app.request import Request
from robotrue.app.workspace_fields import (
    HERE,
    JobWord,
    WorkspaceFolder,
    job_result,
    json_facts,
    time_text,
)

if TYPE_CHECKING:
    from robotrue.store.jobs import Job


class JobsShowRequest(Request):
    """Which job."""

    job: JobWord
    folder: WorkspaceFolder = HERE


def run(request: JobsShowRequest, context: Context) -> PlainResult:
    """Returns one job.

    Raises:
        ConfigurationError: No such job.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        job = jobs.status(workspace, request.job)
    return job_result(job, Facts(title=f"job {job.kind}", rows=_facts(job)))


def _facts(job: Job) -> tuple[tuple[str, str], ...]:
    error = {n: str(v) for n, v in (job.error or {}).items() if v and n != "trace"}
    return (
        ("id", job.id),
        ("state", f"{job.state}, {job.progress:.0%}, attempt {job.attempts}"),
        ("submitted", time_text(job.submitted)),
        ("finished", time_text(job.finished)),
        *json_facts(job.parameters),
        *json_facts(job.result or {}, "result: "),
        *((f"error: {name}", text) for name, text in error.items()),
        *(("remark", remark) for remark in job.remarks),
    )


OPERATION: Final = Operation(request=JobsShowRequest, run=run)
