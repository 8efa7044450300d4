"""Jobs: requested, followed, cancelled."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from robotrue.app.job_parameters import parameter_schemas, stated_parameters
from robotrue.app.kept_inputs import find_uploads, keep_uploads, name_uploads
from robotrue.app.registry import job_operations
from robotrue.errors import ConfigurationError
from robotrue.store import jobs
from robotrue.store.query_defaults import LIMIT
from robotrue.store.workspace import Workspace
from robotrue.web.api.items_routes import Id
from robotrue.web.page_context import ServerContext
from robotrue.web.problems import missing_if_unknown
from robotrue.web.uploads import find_upload, forget


def _with_kinds(schema: dict[str, Any]) -> None:
    """Adds the parameters of each kind that is made from a request to the schema of a body."""
    schema["properties"]["parameters"]["x-parameters-of-kind"] = parameter_schemas()


class Asked(BaseModel):
    """A job that is wanted; ``x-parameters-of-kind`` has the schema of the parameters of each kind.

    Attributes:
        kind: Name of an operation, as ``calibrate`` or ``dynamics_fit``.
        parameters: Those of the kind; items by their ids, files also as ``{"upload": ID}``.
    """

    model_config = ConfigDict(extra="forbid", json_schema_extra=_with_kinds)

    kind: Annotated[str, Field(max_length=40)]
    parameters: dict[str, object] = {}


class Jobs(BaseModel):
    """Some jobs, the newest first."""

    items: list[dict[str, object]]
    total: int
    offset: int


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of jobs."""
    routes = APIRouter(tags=["jobs"])
    workspace = server.workspace

    def get_job(id: str) -> jobs.Job:
        with missing_if_unknown():
            return jobs.status(workspace, id)

    @routes.post("/jobs", status_code=202)
    async def ask_for_job(asked: Asked) -> dict[str, object]:
        """A job that now waits to be done; watch it at ``/api/jobs/{id}``."""
        known = server.settings.kinds
        if asked.kind not in known:
            raise ConfigurationError(
                f"a job of kind {asked.kind!r}, expected one of {', '.join(sorted(known))}."
            )
        return await start_job(server, asked.kind, asked.parameters)

    @routes.get("/jobs")
    def list_jobs(
        state: Annotated[str | None, Query(max_length=40)] = None,
        kind: Annotated[str | None, Query(max_length=40)] = None,
        offset: Annotated[int, Query(ge=0, le=10_000_000)] = 0,
        limit: Annotated[int, Query(ge=1, le=1000)] = LIMIT,
    ) -> Jobs:
        """Jobs, the newest first; of one state or kind, or all."""
        page = jobs.search(workspace, state=state, kind=kind, offset=offset, limit=limit)
        return Jobs(
            items=[job_document(each) for each in page.items],
            total=page.total,
            offset=page.offset,
        )

    @routes.get("/jobs/{id}")
    def show_job(id: Id) -> dict[str, object]:
        """Current state of a job."""
        return job_document(get_job(id))

    @routes.post("/jobs/{id}/cancel")
    def cancel_job(id: Id) -> dict[str, object]:
        """The job, which is over or soon will be."""
        return job_document(jobs.cancel(workspace, get_job(id).id))

    return routes


async def start_job(
    server: ServerContext, kind: str, parameters: Mapping[str, object]
) -> dict[str, object]:
    """Queues a job, wakes the job process, and returns the job as JSON values."""
    id = await asyncio.to_thread(submit_job, server.workspace, kind, parameters)
    server.job_process.wake()
    return job_document(await asyncio.to_thread(jobs.status, server.workspace, id))


def submit_job(workspace: Workspace, kind: str, parameters: Mapping[str, object]) -> jobs.JobId:
    """Queues a job and returns its id; files sent with it are saved as documents.

    Raises:
        ConfigurationError: Invalid parameters, or no such upload; nothing is kept then.
    """
    operation = job_operations().get(kind)
    if operation is None:  # a kind of others
        return jobs.submit(workspace, kind, parameters)
    paths = find_uploads(operation, parameters, functools.partial(find_upload, workspace))
    stated_parameters(operation, name_uploads(parameters, paths))
    with workspace.write() as into:
        id = jobs.submit(into, kind, keep_uploads(into, parameters, paths))
    for each in paths:  # only what is kept: after a refusal one tries again
        forget(workspace, each)
    return id


def job_document(job: jobs.Job) -> dict[str, object]:
    """Returns a job as JSON values; of an error without the trace, which is for the log."""
    out: dict[str, object] = {"over": job.over}
    for field in fields(job):
        value = getattr(job, field.name)
        if isinstance(value, datetime):
            value = value.isoformat()
        elif field.name == "error" and value is not None:
            value = {k: v for k, v in value.items() if k != "trace"}
        out[field.name] = value
    return out
