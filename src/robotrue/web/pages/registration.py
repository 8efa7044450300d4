"""Registration: sessions at the part, and what came of them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from nicegui import ui

from robotrue import __version__
from robotrue.errors import ConfigurationError
from robotrue.measurement.touch_session import session_of
from robotrue.store import items
from robotrue.store.nouns import (
    CELL,
    DOCUMENT,
    MODEL,
    REGISTRATION,
    DocumentRecord,
    RegistrationRecord,
)
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.parts.elements import (
    delete_button,
    facts,
    link_to,
    simulated_mark,
    table,
    tag,
    when,
)
from robotrue.web.parts.faults import not_found
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.naming import heading, record_mark
from robotrue.web.parts.reports import reports
from robotrue.web.parts.touch import TouchBegin, TouchSession

KIND: Final = "touching"
"""Of documents that are sessions; ``store.registrations`` would bring numeric libraries with it."""


async def _build(bench: Bench) -> None:
    ui.add_head_html(f'<link rel="stylesheet" href="/static/touch.css?v={__version__}">')
    session, made = bench.query.get("id"), bench.query.get("registration")
    workspace = bench.house.workspace
    try:
        if session is not None:
            _session(bench, await bench.ask(items.get, workspace, DOCUMENT, session))
        elif made is not None:
            await _registered(bench, await bench.ask(items.get, workspace, REGISTRATION, made))
        else:
            await _list(bench)
    except ConfigurationError as error:
        html(not_found(bench.say, error))


async def _list(bench: Bench) -> None:
    say, workspace = bench.say, bench.house.workspace
    html(
        f"<h1>{escape(say('registration.title'))}</h1>"
        f"<p class='lead'>{escape(say('registration.lead'))}</p>"
    ).classes("head")
    cells = (await bench.ask(items.search, workspace, CELL, ItemQuery(limit=50))).items
    if not cells:
        html(f"<p>{escape(say('registration.needs'))}</p>").classes("card")
        return
    models = (await bench.ask(items.search, workspace, MODEL, ItemQuery(limit=50))).items
    TouchBegin(bench, cells, models)
    asked = ItemQuery(where={"kind": KIND}, limit=100)
    names = {each.id: each.name for each in cells}
    _sessions(bench, (await bench.ask(items.search, workspace, DOCUMENT, asked)).items, names)
    found = await bench.ask(items.search, workspace, REGISTRATION, ItemQuery(limit=100))
    _registrations(bench, found.items, names)


def _sessions(bench: Bench, found: Sequence[DocumentRecord], cells: dict[str, str]) -> None:
    say = bench.say
    rows = []
    for each in found:
        session = session_of(each.detail["session"])
        done = each.detail.get("registration") is not None
        word = say("registration.state_done" if done else "registration.state_running")
        rows.append(
            (
                f"<b>{escape(each.name)}</b>" + simulated_mark(bench.say, session.simulated),
                tag(word, "good" if done else "busy"),
                f"{len(session.kept)} / {len(session.features)}",
                escape(_cell_name(each, cells)),
                when(each.created),
            )
        )
    if not rows:
        return
    columns = [say(f"registration.{c}") for c in ("name", "state", "touches", "of_cell", "when")]
    links = [link_to(f"/registration?id={each.id}") for each in found]
    shown = table(columns, rows, words=(0, 1, 3), attributes=links, mark="sessions")
    html(f"<h2>{escape(say('registration.sessions'))}</h2>{shown}").classes("card")


def _registrations(
    bench: Bench, found: Sequence[RegistrationRecord], cells: dict[str, str]
) -> None:
    say = bench.say
    if not found:
        return
    rows = [
        (
            f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
            _verdict(each.verdict),
            escape(_route(bench, each.method)),
            escape(_cell_name(each, cells)),
            when(each.created),
        )
        for each in found
    ]
    columns = [say(f"registration.{c}") for c in ("name", "verdict", "method", "of_cell", "when")]
    links = [link_to(f"/registration?registration={each.id}") for each in found]
    shown = table(columns, rows, words=(0, 1, 2, 3), attributes=links, mark="registrations")
    html(f"<h2>{escape(say('registration.registered'))}</h2>{shown}").classes("card")


def _session(bench: Bench, record: DocumentRecord) -> None:
    if record.kind != KIND:
        raise ConfigurationError(f"document {record.name!r} is no session of touches.")
    gone = delete_button(bench.say("frame.delete"), "document", record.id, "/registration")
    html(
        f"{heading(bench, 'document', record)}"
        f"<span class='note'>{when(record.created)}</span><div class='acts'>{gone}</div>"
    ).classes("head")
    TouchSession(bench, record.id)


async def _registered(bench: Bench, record: RegistrationRecord) -> None:
    say = bench.say
    linked = record.refs("session")
    simulated, session = False, ""
    if linked:
        found = await bench.ask(items.get, bench.house.workspace, DOCUMENT, linked[0].id)
        simulated = session_of(found.detail["session"]).simulated
        session = (
            f'<a class="act quiet" href="/registration?id={found.id}" data-testid="go-on">'
            f"{escape(say('registration.go_on'))}</a>"
        )
    gone = delete_button(say("frame.delete"), "registration", record.id, "/registration")
    mark = "" if record_mark(say, record) else simulated_mark(say, simulated)  # older records
    html(
        f"{heading(bench, 'registration', record)}{_verdict(record.verdict)}"
        f"{mark}"
        f"<span class='note'>{when(record.created)}</span>"
        f"<div class='acts'>{gone}{session}{_files(bench, record)}</div>"
    ).classes("head")
    html(f"<h2>{escape(say('registration.frames'))}</h2>{_frames(bench, record)}").classes("card")
    rests = [
        (say("registration.method"), _route(bench, record.method)),
        (say("registration.identity"), record.identity),
    ]
    workspace = bench.house.workspace
    for to in record.refs("cell"):
        cell = await bench.ask(items.get, workspace, CELL, to.id, version=to.version)
        rests.append((say("registration.of_cell"), f"{cell.name} v{to.version}"))
    for to in record.refs("model"):
        model = await bench.ask(items.get, workspace, MODEL, to.id, version=to.version)
        rests.append((say("registration.model_named"), f"{model.name} v{to.version}"))
    html(
        f"<h2>{escape(say('registration.rests_on'))}</h2>{facts(rests)}"
        f"<p class='note' style='margin-top:10px'>{escape(say('registration.use'))}</p>"
    ).classes("card")
    page = f"/registration?registration={record.id}"
    await reports(bench, record, "registration", page=page, fields="")


def _frames(bench: Bench, record: RegistrationRecord) -> str:
    say, view = bench.say, bench.view
    rows = [
        (
            f"<b>{escape(str(frame['name']))}</b>",
            *(f"{value:.4f}" for value in (*frame["xyz_mm"], *frame["abc_deg"])),
            str(frame["touches"]),
            escape(", ".join(frame["outliers"])) or "–",
            view.error(float(frame["rms_mm"]) * 1e-3),
            _verdict(str(frame["verdict"])),
        )
        for frame in record.detail["frames"]
    ]
    columns = [
        say("registration.part"), "X mm", "Y mm", "Z mm", "A °", "B °", "C °",
        say("registration.touches"), say("registration.not_believed"),
        f"{say('registration.rms')} {view.unit_name}", say("registration.verdict"),
    ]  # fmt: skip
    return table(columns, rows, words=(0,), mark="frames")


def _files(bench: Bench, record: RegistrationRecord) -> str:
    out = ""
    wanted = "report_zh.html" if bench.say.language == "zh" else "report.html"
    for each in record.attachments:
        where = f"{record.id}/{each.sha256}?version={record.version}"
        if each.role == "report" and each.name == wanted:
            out += (
                f'<a class="act quiet" target="_blank" data-testid="report" '
                f'href="/reports/registration/{where}">'
                f"{escape(bench.say('registration.report'))}</a>"
            )
        elif each.role != "report":
            file = f"{record.id}/files/{each.sha256}?version={record.version}"
            out += (
                f'<a class="act quiet" download data-testid="download" '
                f'href="/api/items/registration/{file}">{icon("download")}{escape(each.name)}</a>'
            )
    return out


def _verdict(word: str) -> str:
    return tag(word, "good" if word == "GO" else "bad")


def _route(bench: Bench, word: str) -> str:
    key = f"registration.route_{word}"
    return bench.say(key) if bench.say.known(key) else word


def _cell_name(record: DocumentRecord | RegistrationRecord, cells: dict[str, str]) -> str:
    return ", ".join(cells.get(to.id, "–") for to in record.refs("cell"))


PAGE: Final = Page(name="registration", path="/registration", build=_build)
