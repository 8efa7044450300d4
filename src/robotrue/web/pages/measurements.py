"""Measured poses: dropped, looked at before they are taken in, judged by a model."""

from __future__ import annotations

from html import escape
from typing import Any, Final

from nicegui import ui

from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import MEASUREMENT, MeasurementRecord, ModelRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.pages.measurements_preview import preview
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import (
    Tile,
    delete_button,
    facts,
    link_to,
    model_field,
    simulated_mark,
    table,
    tag,
    tiles,
    undo_button,
    when,
)
from robotrue.web.parts.faults import not_found
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.later import later
from robotrue.web.parts.naming import heading, record_mark
from robotrue.web.parts.rows import row_pages
from robotrue.web.parts.scene import SceneView

PAGE_ROWS: Final = 100


async def _build(bench: Bench) -> None:
    if bench.query.get("upload"):
        await preview(bench)
        return
    asked = bench.query.get("id")
    if asked is None:
        await _list(bench)
        return
    try:
        record = await bench.ask(items.get, bench.house.workspace, MEASUREMENT, asked)
    except ConfigurationError as error:
        html(not_found(bench.say, error))
        return
    _one(bench, record)


async def _list(bench: Bench) -> None:
    say, text = bench.say, bench.query.get("text", "")
    html(
        f"<h1>{escape(say('measurements.title'))}</h1>"
        f"<p class='lead'>{escape(say('measurements.lead'))}</p>"
    ).classes("head")
    DropZone(
        bench,
        title=say("measurements.drop"),
        hint=say("measurements.drop_hint"),
        accept=".csv,.tsv,.txt,.xlsx,.xls,.ods",
        then="",
        go="/measurements?upload={id}",
    )
    try:
        query = ItemQuery(text=text, limit=200)
        found = await bench.ask(items.search, bench.house.workspace, MEASUREMENT, query)
    except ConfigurationError as error:
        html(not_found(say, error))
        return
    begun = await bench.ask(
        items.read_creation_times, bench.house.workspace, [each.id for each in found.items]
    )
    rows = [
        (
            f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
            f"{each.poses:,}",
            escape(say(f"measurements.frame_{each.frame}")),
            str(len(each.detail.get("stations", ()))),
            when(begun[each.id]),
        )
        for each in found.items
    ]
    links = [link_to(bench.kept(f"/measurements?id={each.id}")) for each in found.items]
    columns = [say(f"measurements.{c}") for c in ("name", "poses", "frame", "stations", "taken")]
    filtered = (
        '<form method="get" style="margin-bottom:8px"><input type="search" name="text" '
        f'value="{escape(text, quote=True)}" placeholder="{escape(say("frame.filter"))}" '
        f'style="max-width:340px" data-testid="filter">{model_field(bench)}</form>'
    )
    if rows or text:
        shown = table(columns, rows, words=(0, 2), attributes=links, mark="sets")
        html(filtered + shown).classes("card").style("margin-top:14px")


def _one(bench: Bench, record: MeasurementRecord) -> None:
    say = bench.say
    raw = "".join(
        f'<a class="act quiet" download href="/api/items/measurement/{record.id}/files/{f.sha256}'
        f'?version={record.version}">{icon("download")}{escape(f.name)}</a>'
        for f in record.attachments
    )
    gone, state = delete_button(say("frame.delete"), "measurement", record.id, "/measurements"), ""
    if record.deleted:
        gone = undo_button(say("history.undo"), "measurement", record.id, record.version)
        state = tag(say("history.action_deleted"), "caution")
    html(
        f"{heading(bench, 'measurement', record)}{state}"
        f"<span class='note'>{when(record.created)}</span>"
        f"<div class='acts'>{gone}{raw}</div>"
    ).classes("head")
    html(
        tiles(
            [
                Tile(label=say("measurements.poses"), value=f"{record.poses:,}"),
                Tile(label=say("measurements.full"), value=f"{record.full_poses:,}"),
                Tile(label=say("measurements.joints"), value=str(record.dof)),
                Tile(
                    label=say("measurements.frame"),
                    value=say(f"measurements.frame_{record.frame}"),
                ),
            ]
        )
    ).classes("tiles")
    if bench.model is not None:
        _by_model(bench, record, bench.model)
    _provenance(bench, record)
    _rows(bench, record)


def _by_model(bench: Bench, record: MeasurementRecord, model: ModelRecord) -> None:
    house = bench.house
    folder = str(house.workspace.folder)

    async def ask() -> bytes:
        return await house.answers.once(
            "measured.judged", folder, record.id, record.version, model.id, model.version
        )

    source = f"/api/scenes/measurement/{record.id}?model={model.id}&version={record.version}"
    later(bench, ask, lambda found: _judged(bench, found, source))


def _judged(bench: Bench, found: dict[str, Any], source: str) -> None:
    say, view = bench.say, bench.view
    simulated = simulated_mark(say, found["simulated"])
    share = 100.0 * found["coverage"]
    kind = say("measurements.fitted" if found["fitted"] else "measurements.unseen")
    shown = tiles(
        [
            Tile(
                label=say(f"measurements.error_{name}"),
                value=view.error(found["after_m"][name]),
                unit=view.unit_name,
                was=f"{say('scene.before')} {view.error(found['before_m'][name])}",
            )
            for name in ("mean", "p95", "max")
        ]
        + [Tile(label=say("measurements.coverage"), value=f"{share:.0f}", unit="%")]
    )
    title = escape(say("measurements.by_model", model=found["model"]))
    html(f"<h2>{title}{simulated}</h2><p class='note'>{escape(kind)}</p>").style("margin:8px 0")
    html(shown).classes("tiles")
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("card"):
            SceneView(bench, source)
        with ui.element("div"):
            html(f"<h2>{escape(say('measurements.worst'))}</h2>{_worst(bench, found)}").classes(
                "card"
            )
            html(_screening(bench, found["screening"])).classes("card").props(
                'data-testid="screening"'
            )


def _worst(bench: Bench, found: dict[str, Any]) -> str:
    say, view = bench.say, bench.view
    columns = [
        say("measurements.line"),
        f"{say('scene.before')} {view.unit_name}",
        f"{say('scene.after')} {view.unit_name}",
    ]
    rows = [
        (str(each["line"]), view.error(each["before_m"]), view.error(each["after_m"]))
        for each in found["worst"]
    ]
    marks = [f'data-point="{each["row"] - 1}" tabindex="0"' for each in found["worst"]]
    return table(columns, rows, attributes=marks, mark="worst")


def _screening(bench: Bench, found: dict[str, Any]) -> str:
    say = bench.say
    title = f"<h2>{escape(say('measurements.screening'))}</h2>"
    if found["refused"]:
        return f"{title}<p>{escape(found['refused'])}</p>"
    if not found["findings"]:
        return f"{title}<p class='note'>{escape(say('measurements.screening_none'))}</p>"
    listed = "".join(f"<li>{escape(each)}</li>" for each in found["findings"])
    return f"{title}<ul class='doubts'>{listed}</ul>"


def _provenance(bench: Bench, record: MeasurementRecord) -> None:
    say, detail = bench.say, record.detail
    remarks = "".join(f"<li>{escape(each)}</li>" for each in detail.get("remarks") or ())
    found = [
        (say("measurements.source"), "; ".join(detail.get("sources", ()))),
        (say("measurements.sets"), ", ".join(detail.get("groups", ()))),
        (say("measurements.data"), record.data),
    ]
    html(
        f"<h2>{escape(say('measurements.provenance'))}</h2>{facts(found)}"
        f"<ul class='doubts'>{remarks}</ul>"
    ).classes("card")


def _rows(bench: Bench, record: MeasurementRecord) -> None:
    sort, offset = bench.query.get("sort", ""), bench.query.get("offset", "0")
    start = int(offset) if offset.isdigit() and len(offset) < 10 else 0
    house = bench.house

    async def ask() -> bytes:
        folder = str(house.workspace.folder)
        facts_of = (folder, record.id, record.version, sort, start, PAGE_ROWS)
        return await house.answers.once("measured.rows", *facts_of)

    address = bench.kept(f"/measurements?id={record.id}")
    later(bench, ask, lambda found: row_pages(bench, found, address, sort))


PAGE: Final = Page(name="measurements", path="/measurements", build=_build)
