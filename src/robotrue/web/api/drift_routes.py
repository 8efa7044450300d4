"""Drift checks: the measured file of a few poses goes in, a job says what they tell."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, Field

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store import jobs
from robotrue.store.nouns import MODEL
from robotrue.web.api.items_routes import get_item
from robotrue.web.api.jobs_routes import job_document
from robotrue.web.page_context import ServerContext
from robotrue.web.uploads import find_upload, forget

UploadId = Annotated[str, Field(pattern="^[0-9a-f]{32}$")]


class CheckPoses(BaseModel):
    """Uploads with a few poses measured again.

    Attributes:
        uploads: Ids of uploads.
        model: Id of the model they are to check.
        name: Of the measurement set; empty: that of the file.
    """

    uploads: Annotated[list[UploadId], Field(min_length=1, max_length=20)]
    model: Annotated[str, Field(max_length=40)]
    name: Annotated[str, Field(max_length=200)] = ""


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of drift checks."""
    routes = APIRouter(tags=["drift checks"])
    workspace = server.workspace

    @routes.post("/drift-checks", status_code=202)
    async def check_drift(asked: CheckPoses) -> dict[str, object]:
        """The job that judges the poses; they stand as a measurement set already."""
        paths = [find_upload(workspace, each) for each in asked.uploads]
        await asyncio.to_thread(get_item, workspace, MODEL.name, asked.model)
        made = await server.workers.ask(
            calls.import_check_poses, str(workspace.folder), paths, asked.name, asked.model
        )
        for each in asked.uploads:
            await asyncio.to_thread(forget, workspace, each)
        stated = {"model": asked.model, "measurements": [made.id]}
        id = await asyncio.to_thread(jobs.submit, workspace, "drift", stated)
        server.job_process.wake()
        return job_document(await asyncio.to_thread(jobs.status, workspace, id))

    return routes
