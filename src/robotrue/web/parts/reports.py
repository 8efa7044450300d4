"""Reports to hand over: those of an item, those under way, and fields of a form for another.

Their pages are shown as they are: no script runs in them, nothing is loaded.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response
from markupsafe import Markup

from robotrue.app.operations.report import ReportRequest
from robotrue.app.request import fields_of
from robotrue.store.jobs import Job
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.web.api.items_routes import Digest, Id, NounName, Version, get_item
from robotrue.web.page_context import PageContext, ServerContext
from robotrue.web.parts.request_form import RequestForm
from robotrue.web.problems import MissingError

KIND: Final = "report"
SHUT: Final = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""A report holds what users named things; whatever stands in it, it can only be read."""
ROLES: Final = frozenset({"report", "file"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Reports:
    """Reports of one item, for the macro ``reports``.

    Attributes:
        jobs: That make further ones.
        documents: The newest first.
        fields: HTML of fields of the form.
    """

    jobs: Sequence[Job]
    documents: Sequence[DocumentRecord]
    fields: Markup


async def find_reports(
    context: PageContext,
    about: ItemRecord,
    subject: str,
    *names: str,
    sets: Sequence[ItemRecord] = (),
    **values: float | None,
) -> Reports:
    """Returns the reports of an item.

    Args:
        context: Of the page.
        about: What they are reports of.
        subject: The parameter of the job that names it.
        names: Of fields of the form.
        sets: Measurements to choose from.
        values: What stands in a field at first.
    """
    form = RequestForm(
        context=context,
        request=ReportRequest,
        group="reports",
        records={"measurement": sets},
        marks={"measurements": "report-set"},
        values=values,
    )
    wanted = [form.control(each) for each in fields_of(ReportRequest) if each.name in names]
    asked = ItemQuery(where={"kind": KIND}, linked=("about", about.id), limit=20)
    return Reports(
        jobs=await context.jobs(KIND, **{subject: about.id}),
        documents=await context.items(DOCUMENT, asked),
        fields=Markup().join(wanted),
    )


def reports_router(server: ServerContext) -> APIRouter:
    """Returns the route ``/reports``."""
    router = APIRouter(include_in_schema=False)

    @router.get("/reports/{noun}/{id}/{sha256}")
    async def show(noun: NounName, id: Id, sha256: Digest, version: Version = None) -> Response:
        record = await asyncio.to_thread(get_item, server.workspace, noun, id, version)
        for each in record.attachments:
            page = each.name.lower().endswith((".html", ".htm"))
            if each.sha256 == sha256 and each.role in ROLES and page:
                path = await asyncio.to_thread(server.workspace.path_of, sha256)
                headers = {"Content-Security-Policy": SHUT}
                return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)
        raise MissingError(f"{noun} {record.name!r} has no report {sha256[:12]}.")

    return router
