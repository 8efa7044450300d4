"""End a job; nothing of it stands."""

from __future__ import annotations

from typing import Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Request
from robotrue.app.workspace_fields import HERE, JobWord, WorkspaceFolder, job_result


class JobsCancelRequest(Request):
    """Which job."""

    job: JobWord
    folder: WorkspaceFolder = HERE


def run(request: JobsCancelRequest, context: Context) -> PlainResult:
    """Ends a job.

    Raises:
        ConfigurationError: No such job.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        job = jobs.cancel(workspace, request.job)
    context.inform(f"job {job.id} is {job.state}" + ("" if job.over else " and will be cancelled"))
    return job_result(job)


OPERATION: Final = Operation(request=JobsCancelRequest, run=run)
