"""Reports to download: those of an item, those in progress, and fields of a form for another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

from markupsafe import Markup

from robotrue.app.operations.report import ReportRequest
from robotrue.app.request import fields_of
from robotrue.report.certificate_head import CertificateHead
from robotrue.report.dcc import REQUIRED
from robotrue.store.jobs import Job
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.web.page_context import PageContext
from robotrue.web.parts.request_form import RequestForm

KIND: Final = "report"
TYPED: Final = {"str": "text", "float | None": "number", "datetime.date | None": "date"}
"""How a key of the head of a certificate is typed; a logo is a file and is not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reports:
    """Reports of one item, for the macro ``reports``.

    Attributes:
        jobs: That make further ones.
        documents: The newest first.
        fields: HTML of fields of the form.
        head: Keys of the head of a certificate, how each is typed, and whether a Digital
            Calibration Certificate needs it.
    """

    jobs: Sequence[Job]
    documents: Sequence[DocumentRecord]
    fields: Markup
    head: Sequence[tuple[str, str, bool]] = ()


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
        about: The item of the reports.
        subject: The parameter of the job that names it.
        names: Of fields of the form.
        sets: Measurements to choose from.
        values: Initial values of fields.
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
        head=_list_head() if subject == "model" else (),
    )


def _list_head() -> list[tuple[str, str, bool]]:
    stated = ((each.name, str(each.type)) for each in fields(CertificateHead))
    return [(name, TYPED[kind], name in REQUIRED) for name, kind in stated if kind in TYPED]
