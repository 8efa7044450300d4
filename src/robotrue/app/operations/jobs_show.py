"""Show one job: parameters, remarks, result or error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotrue.app import workspace_fields as fields
from robotrue.app.context import Context
from robotrue.app.job_files import BLOCKS
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts
from robotrue.app.request import Request

if TYPE_CHECKING:
    from robotrue.store.jobs import Job


class JobsShowRequest(Request):
    """Which job."""

    job: fields.JobWord
    folder: fields.WorkspaceFolder = fields.HERE


def run(request: JobsShowRequest, context: Context) -> PlainResult:
    """Returns one job.

    Raises:
        ConfigurationError: No such job.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        job = jobs.status(workspace, request.job)
    return fields.job_result(job, Facts(title=f"job {job.kind}", rows=_facts(job)))


def _facts(job: Job) -> tuple[tuple[str, str], ...]:
    found = {n: v for n, v in (job.result or {}).items() if n != BLOCKS}
    error = {n: str(v) for n, v in (job.error or {}).items() if v and n != "trace"}
    return (
        ("id", job.id),
        ("state", f"{job.state}, {job.progress:.0%}, attempt {job.attempts}"),
        ("submitted", fields.time_text(job.submitted)),
        ("finished", fields.time_text(job.finished)),
        *fields.json_facts(job.parameters),
        *fields.json_facts(found, "result: "),
        *((f"error: {name}", text) for name, text in error.items()),
        *(("remark", remark) for remark in job.remarks),
    )


OPERATION: Final = Operation(request=JobsShowRequest, run=run)
