"""Drilling: the monitor of a session, the campaign and what it taught, tests and their reports."""

from __future__ import annotations

from html import escape
from typing import Final

from nicegui import ui

from robotrue import __version__
from robotrue.drilling.drill_defaults import CAMPAIGN, JOURNAL, MODEL, TEST
from robotrue.store import items
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.drill_journals import FOLDER, JournalFile, folder_of, journals
from robotrue.web.pages.drilling_model import model_cards
from robotrue.web.parts.drilling import DrillMonitor
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import delete_button, link_to, table, when
from robotrue.web.parts.frame import html
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.naming import record_mark

VIEWS: Final = ("monitor", "model")
TOLERANCE_DEG: Final = 0.1


async def _build(bench: Bench) -> None:
    say = bench.say
    ui.add_head_html(f'<link rel="stylesheet" href="/static/drilling.css?v={__version__}">')
    found = await bench.ask(journals, bench.house.workspace)
    kept = await _documents(bench, JOURNAL)
    models = await _documents(bench, MODEL)
    view = bench.query.get("view", "")
    if view not in VIEWS:
        view = "monitor" if (found or kept) and "id" not in bench.query else "model"
    tabs = "".join(
        f'<a href="/drilling?view={each}" data-testid="view-{each}"'
        f"{' aria-current=page' if each == view else ''}>{escape(say(f'drilling.view_{each}'))}</a>"
        for each in VIEWS
    )
    html(
        f"<h1>{escape(say('nav.drilling'))}</h1><span class='views'>{tabs}</span>"
        f"<p class='lead'>{escape(say(f'drilling.lead_{view}'))}</p>"
    ).classes("head")
    if view == "monitor":
        await _monitor(bench, found, kept)
    else:
        await _model(bench, models)


async def _documents(bench: Bench, kind: str) -> tuple[DocumentRecord, ...]:
    query = ItemQuery(where={"kind": kind}, limit=100)
    return (await bench.ask(items.search, bench.house.workspace, DOCUMENT, query)).items


async def _monitor(
    bench: Bench, found: list[JournalFile], kept: tuple[DocumentRecord, ...]
) -> None:
    say = bench.say
    sources = {f"/api/drilling/journals/{each.name}": each.name for each in found}
    sources |= {f"/api/drilling/kept-journals/{each.id}": each.name for each in kept}
    if not sources:
        place = await bench.ask(folder_of, bench.house.workspace)
        command = f"robotrue drill run drill.robotrue --journal {place / 'holes.jsonl'}"
        html(
            f"<h2>{escape(say('drilling.no_journal'))}</h2><p>{escape(say('drilling.how'))}</p>"
            f"<p><code class='mono'>{escape(command)}</code></p>"
            f"<p class='note'>{escape(say('drilling.how_practise'))}</p>"
        ).classes("card")
        _drop(bench)
        return
    asked = bench.query.get("journal", "")
    source = asked if asked in sources else next(iter(sources))
    tolerance = _tolerance(bench)
    options = "".join(
        f'<option value="{escape(each)}"{" selected" if each == source else ""}>'
        f"{escape(name)}</option>"
        for each, name in sources.items()
    )
    mark = escape(say("scene.simulated"))
    ended = next((e for e in kept if source.endswith(e.id)), None)
    gone = delete_button(say("frame.delete"), "document", ended.id, "/drilling") if ended else ""
    html(
        "<form class='drill-line' method='get'><input type='hidden' name='view' value='monitor'>"
        f"<label class='field'>{escape(say('drilling.journal'))}<select name='journal' "
        f"onchange='this.form.submit()' data-testid='journal'>{options}</select></label>"
        f"<label class='field short'>{escape(say('drilling.tolerance'))}<input type='number' "
        f"name='tolerance_deg' min='0.0001' step='any' value='{tolerance:g}'></label>"
        f"<button class='act quiet'>{escape(say('drilling.judge'))}</button>{gone}"
        f'<span class="simulated" data-simulated-later hidden>{mark}</span></form>'
    ).classes("card")
    DrillMonitor(bench, tolerance_deg=tolerance, source=source)
    if ended is None:
        html(f"<p class='note'>{escape(say('drilling.follows', folder=FOLDER))}</p>")


async def _model(bench: Bench, models: tuple[DocumentRecord, ...]) -> None:
    say, workspace = bench.say, bench.house.workspace
    for kind, title in (("drill_fit", "learning_now"), ("drill_report", "judging_now")):
        for job in await bench.ask(under_way, workspace, kind):
            JobCard(
                bench,
                job,
                title=say(f"drilling.{title}"),
                go="/drilling?view=model&id={id}" if kind == "drill_fit" else "/drilling?test={id}",
                field="document",
            )
    campaigns, tests = await _documents(bench, CAMPAIGN), await _documents(bench, TEST)
    test = next((each for each in tests if each.id == bench.query.get("test")), None)
    wanted = test.refs("model")[0].id if test is not None else bench.query.get("id", "")
    shown = next((each for each in models if each.id == wanted), models[0] if models else None)
    if shown is not None:
        own = [each for each in tests if any(to.id == shown.id for to in each.refs("model"))]
        if test is not None:
            own = [test, *(each for each in own if each.id != test.id)]
        model_cards(bench, shown, own, campaigns, tolerance_deg=TOLERANCE_DEG)
    if campaigns:
        html(f"<h2>{escape(say('drilling.campaigns'))}</h2>{_campaigns(bench, campaigns)}").classes(
            "card"
        )
    _drop(bench)
    if len(models) > 1:
        rows = [
            (
                f"<b>{escape(e.name)}</b>{record_mark(say, e)}",
                escape(say(f"drilling.kind_{e.detail['kind']}")),
                when(e.created),
            )
            for e in models
        ]
        links = [link_to(f"/drilling?view=model&id={each.id}") for each in models]
        columns = [say("drilling.name"), say("drilling.correction"), say("drilling.taken")]
        listed = table(columns, rows, words=(0, 1), attributes=links, mark="drill-models")
        html(f"<h2>{escape(say('drilling.models'))}</h2>{listed}").classes("card").style(
            "margin-top:14px"
        )


def _campaigns(bench: Bench, campaigns: tuple[DocumentRecord, ...]) -> str:
    say = bench.say
    rows = []
    for each in campaigns:
        d = each.detail
        rows.append(
            (
                f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
                str(d["clamps"]),
                f"{d['force_N'][0]:.0f} … {d['force_N'][1]:.0f}",
                f"{d['z_mm'][0]:.0f} … {d['z_mm'][1]:.0f}",
                f"{d['tilt_deg']:.1f}",
                f'<span class="pair"><button class="act quiet" data-testid="learn" '
                "onclick=\"bench.job('drill_fit',"
                f"{{campaign:'{each.id}'}},this)\">{escape(say('drilling.learn'))}</button>"
                + delete_button(say("frame.delete"), "document", each.id, "/drilling?view=model")
                + "</span>",
            )
        )
    columns = [
        say("drilling.name"), say("drilling.clamps"), f"{say('drilling.force')} N",
        f"{say('drilling.height')} mm", f"{say('drilling.tilt')} deg", "",
    ]  # fmt: skip
    return table(columns, rows, mark="campaigns")


def _drop(bench: Bench) -> None:
    DropZone(
        bench,
        title=bench.say("drilling.drop"),
        hint=bench.say("drilling.drop_hint"),
        accept="",
        then="/api/drilling",
        go="/drilling?view=" + ("monitor" if bench.query.get("view") == "monitor" else "model"),
    )


def _tolerance(bench: Bench) -> float:
    try:
        stated = float(bench.query.get("tolerance_deg", TOLERANCE_DEG))
    except ValueError:
        return TOLERANCE_DEG
    return stated if 0.0 < stated <= 45.0 else TOLERANCE_DEG


PAGE: Final = Page(name="drilling", path="/drilling", build=_build)
