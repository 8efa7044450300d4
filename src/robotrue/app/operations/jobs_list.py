"""Show the jobs and how far they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import workspace_fields as fields
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Table, count
from robotrue.app.request import Option, Request
from robotrue.store.query_defaults import LIMIT

if TYPE_CHECKING:
    from robotrue.store.jobs import Job


class JobsListRequest(Request):
    """Which jobs."""

    state: Annotated[str | None, Option(help="queued, running, done, failed or cancelled.")] = None
    limit: Annotated[int, Option(help="Jobs shown, the newest first.")] = LIMIT
    folder: fields.WorkspaceFolder = fields.HERE


def run(request: JobsListRequest, context: Context) -> PlainResult:
    """Returns the jobs, the newest first.

    Raises:
        ConfigurationError: No such state.
    """
    from robotrue.store import jobs
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        page = jobs.search(workspace, state=request.state, limit=request.limit)
    return PlainResult(
        values={"total": page.total, "jobs": [fields.job_document(job) for job in page.items]},
        shown=(
            Table(
                title=count(page.total, "job"),
                columns=("id", "kind", "state", "done", "attempts", "submitted", "", ""),
                rows=tuple(_row(job) for job in page.items),
                words=True,
            ),
        ),
    )


def _row(job: Job) -> tuple[str, ...]:
    from robotrue.core.provenance import simulation_mark

    return (
        job.id[:8],
        job.kind,
        job.state,
        f"{job.progress:.0%}",
        str(job.attempts),
        fields.time_text(job.submitted),
        job.text if job.error is None else str(job.error["message"]),
        simulation_mark(fields.is_simulated(job)),
    )


OPERATION: Final = Operation(request=JobsListRequest, run=run)
