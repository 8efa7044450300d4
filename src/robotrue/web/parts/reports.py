"""Reports to hand over: those of an item, those under way, and a form that asks for one."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from robotrue.app.operations.report import ReportRequest
from robotrue.app.request import fields_of
from robotrue.store import items
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import Attachment, ItemQuery, ItemRecord
from robotrue.web.bench import Bench
from robotrue.web.language import LANGUAGES
from robotrue.web.parts.elements import Tone, table, tag, when
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.request_form import RequestForm

KIND: Final = "report"
TONES: Final[dict[str, Tone]] = {
    "good": "good", "bad": "bad", "caution": "caution", "plain": "plain",
}  # fmt: skip


async def reports(bench: Bench, about: ItemRecord, subject: str, *, page: str, fields: str) -> None:
    """Shows the reports of an item, newest first, and the form for another.

    Args:
        bench: Who looks.
        about: What they are reports of.
        subject: The parameter of the job that names it.
        page: Address opened when a report is done.
        fields: HTML of further fields of the form, nothing a user wrote unescaped in it.
    """
    say, workspace = bench.say, bench.house.workspace
    for job in await bench.ask(under_way, workspace, KIND):
        if job.parameters.get(subject) == about.id:
            title = say("reports.running")
            JobCard(bench, job, title=title, go=f"{page}&report={{id}}", field="document")
    asked = ItemQuery(where={"kind": KIND}, linked=("about", about.id), limit=20)
    found = (await bench.ask(items.search, workspace, DOCUMENT, asked)).items
    speech = "".join(
        f'<option value="{code}"{" selected" if code == say.language else ""}>{name}</option>'
        for code, name in LANGUAGES.items()
    )
    html(
        f"<h2>{escape(say(f'reports.title_{subject}'))}</h2>"
        f"<p class='note'>{escape(say(f'reports.text_{subject}'))}</p>"
        f"{_listed(bench, found) if found else ''}"
        "<form data-testid='report-form' style='display:flex;flex-wrap:wrap;gap:10px;"
        "align-items:end;margin-top:14px' onsubmit=\"return bench.jobForm('report',this)\">"
        f"<input type='hidden' name='{subject}' value='{about.id}'>{fields}"
        f"<label class='field'>{escape(say('view.language'))}"
        f"<select name='lang' data-testid='report-lang'>{speech}</select></label>"
        f"<button class='act' data-testid='report-make'>{escape(say('reports.make'))}</button>"
        "</form>"
    ).classes("card").props('data-testid="reports"')


def report_form(bench: Bench, *names: str, sets: Sequence[ItemRecord] = (), **values: float) -> str:
    """Returns the HTML of fields of the form.

    Args:
        bench: Who looks.
        names: Of the fields.
        sets: Measurements to choose from.
        values: What stands in a field at first.
    """
    form = RequestForm(
        bench=bench,
        request=ReportRequest,
        group="reports",
        records={"measurement": sets},
        marks={"measurements": "report-set"},
        values=values,
    )
    return "".join(form.control(each) for each in fields_of(ReportRequest) if each.name in names)


def _listed(bench: Bench, found: tuple[DocumentRecord, ...]) -> str:
    say = bench.say
    rows = [
        (
            when(each.created),
            tag(str(each.detail["verdict"]), TONES[each.detail["tone"]])
            if each.detail.get("verdict")
            else "",
            escape(str(each.detail["text"])),
            escape(LANGUAGES[each.detail["lang"]]),
            "<div style='display:flex;gap:6px;justify-content:flex-end'>"
            + "".join(_file(each, file) for file in each.attachments)
            + "</div>",
        )
        for each in found
    ]
    columns = [say("history.when"), "", say("reports.says"), say("view.language"), ""]
    return table(columns, rows, words=(0, 1, 2, 3), mark="report-list")


def _file(record: DocumentRecord, file: Attachment) -> str:
    """A page opens, everything else is downloaded."""
    form = file.name.rpartition(".")[2]
    where = f"{record.id}/{file.sha256}?version={record.version}"
    if form == "html":
        return (
            f'<a class="act quiet" target="_blank" data-testid="report-html" '
            f'href="/reports/document/{where}">HTML</a>'
        )
    address = f"/api/items/document/{record.id}/files/{file.sha256}?version={record.version}"
    return (
        f'<a class="act quiet" download data-testid="report-{escape(form)}" href="{address}">'
        f"{icon('download')}{escape(form.upper())}</a>"
    )
