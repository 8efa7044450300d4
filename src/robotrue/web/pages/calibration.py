"""The calibration: started, watched, and what it learned, how surely, and what it could not."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any, Final

from nicegui import ui

from robotrue.app.operations.calibrate import CalibrateRequest
from robotrue.app.request import FORM, fields_of
from robotrue.report.words import ReportTexts
from robotrue.store import items
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, ModelRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.parts.elements import (
    Tile,
    Tone,
    delete_button,
    facts,
    link_to,
    simulated_mark,
    table,
    tag,
    tiles,
    undo_button,
    when,
)
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.interval import interval
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.later import later
from robotrue.web.parts.naming import heading, record_mark
from robotrue.web.parts.reports import report_form, reports
from robotrue.web.parts.request_form import RequestForm

KNOWN: Final[Mapping[str, Tone]] = {
    "seen": "good", "weakly seen": "caution", "prior only": "bad",
}  # fmt: skip


async def _build(bench: Bench) -> None:
    say, workspace = bench.say, bench.house.workspace
    for job in await bench.ask(under_way, workspace, "calibrate"):
        JobCard(
            bench,
            job,
            title=say("calibration.running"),
            go="/calibration?model={id}",
            field="model",
        )
    if bench.model is None:
        html(
            f"<h1>{escape(say('nav.calibration'))}</h1>"
            f"<p class='lead'>{escape(say('calibration.lead'))}</p>"
        ).classes("head")
    else:
        _model(bench, bench.model)
        await _certificate(bench, bench.model)
    await _new(bench)
    await _others(bench)


def _model(bench: Bench, model: ModelRecord) -> None:
    say, house = bench.say, bench.house
    report = "".join(
        f'<a class="act quiet" target="_blank" href="/reports/model/{model.id}/{each.sha256}'
        f'?version={model.version}">{escape(say("calibration.report"))}</a>'
        for each in model.files("report")[:1]
    )
    file = "".join(
        f'<a class="act quiet" download href="/api/items/model/{model.id}/files/{each.sha256}'
        f'?version={model.version}">{icon("download")}{escape(say("calibration.file"))}</a>'
        for each in model.files("model")
    )
    gone, state = delete_button(say("frame.delete"), "model", model.id, "/calibration"), ""
    if model.deleted:
        gone = undo_button(say("history.undo"), "model", model.id, model.version)
        state = tag(say("history.action_deleted"), "caution")
    html(
        f"{heading(bench, 'model', model)}{tag(f'v{model.version}')}{state}"
        f"<span class='note'>{escape(model.robot)}, {when(model.created)}</span>"
        f"<div class='acts'>{gone}{report}{file}</div>"
    ).classes("head")

    async def ask() -> bytes:
        folder = str(house.workspace.folder)
        return await house.answers.once("calibration.shown", folder, model.id, model.version)

    later(bench, ask, lambda found: _show(bench, model, found))


def _show(bench: Bench, model: ModelRecord, found: dict[str, Any]) -> None:
    say = bench.say
    html(_tiles(bench, found)).classes("tiles").props('data-testid="calibration-tiles"')
    with ui.element("div").classes("columns"):
        with ui.element("div"):
            html(
                f"<h2>{escape(say('calibration.parameters'))}</h2>{_parameters(bench, found)}"
            ).classes("card")
        with ui.element("div"):
            html(f"<h2>{escape(say('calibration.doubts'))}</h2>{_doubts(bench, found)}").classes(
                "card"
            ).props('data-testid="doubts"')
            if found["contest"]:
                html(_contest(bench, found["contest"])).classes("card")
            if found["stiffness"] or found["drives"]:
                html(_joints(bench, found)).classes("card")
            html(
                f"<h2>{escape(say('measurements.provenance'))}</h2>"
                + facts(
                    [
                        (say("calibration.made_by"), f"robotrue {model.made_by}"),
                        (say("calibration.identity"), model.identity),
                        (say("measurements.data"), str(model.detail.get("data_sha256", ""))),
                    ]
                )
            ).classes("card")


def _tiles(bench: Bench, found: dict[str, Any]) -> str:
    say, view = bench.say, bench.view

    def length(key: str, value: float | None) -> list[Tile]:
        if value is None:
            return []
        label = say(f"calibration.{key}")
        return [Tile(label=label, value=view.error(value), unit=view.unit_name)]

    determined = found["verdict"] == "determined"
    verdict = f"calibration.verdict_{found['verdict']}"
    poses = f"{found['poses']:,}"
    screened = say("calibration.screened", count=found["screened"]) if found["screened"] else ""
    out = [
        Tile(
            label=say("calibration.verdict"),
            value=say(verdict) if say.known(verdict) else found["verdict"] or "–",
            tone="good" if determined else "caution",
        ),
        *length("held_out", found["held_out_m"]),
        *length("noise", found["noise_m"]),
        Tile(label=say("calibration.method"), value=_method(bench, found["method"])),
        Tile(label=say("measurements.poses"), value=poses, was=screened),
    ]
    mark = simulated_mark(say, found["simulated"])
    return tiles(out) + (f"<div>{mark}</div>" if mark else "")


def _method(bench: Bench, name: str) -> str:
    """The name of a method in the reader's language; one that is not known as it is."""
    key = f"calibration.model_{name}"
    return bench.say(key) if bench.say.known(key) else name


def _parameters(bench: Bench, found: dict[str, Any]) -> str:
    say = bench.say
    rows_by_unit: dict[str, float] = {}
    for row in found["parameters"].values():
        size = abs(row["value"] or 0.0) + 2.0 * (row["sd"] or 0.0)
        rows_by_unit[row["unit"]] = max(rows_by_unit.get(row["unit"], 0.0), size)
    rows = [
        (
            f'<span class="mono">{escape(name)}</span>',
            _number(row["value"]),
            _number(row["sd"]),
            escape(row["unit"]),
            interval(row["value"], row["sd"], rows_by_unit[row["unit"]]),
            tag(
                say(f"calibration.known_{row['known'].replace(' ', '_')}"),
                KNOWN.get(row["known"], "plain"),
            )
            if row["known"] in KNOWN
            else "",
        )
        for name, row in found["parameters"].items()
    ]
    columns = ["", say("calibration.value"), "±", "", "", say("calibration.known")]
    return table(columns, rows, words=(0, 3, 5), mark="parameters")


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}" if abs(value) < 100 else f"{value:.1f}"


def _doubts(bench: Bench, found: dict[str, Any]) -> str:
    words = ReportTexts(lang="zh" if bench.say.language == "zh" else "en")
    names = {each["name"] for each in found["unseen"]}
    rows = []
    for doubt in found["doubts"]:
        said = words.sentence(doubt)
        # The combination of parameters is the same in every language; it stands out.
        name = max((each for each in names if each in said), key=len, default="")
        before, _, after = said.partition(name) if name else ("", "", said)
        marked = f"<span class='mono'>{escape(name)}</span>" if name else ""
        rows.append(f"<li>{escape(before)}{marked}{escape(after)}</li>")
    if not rows:
        return f"<p class='note'>{escape(bench.say('calibration.no_doubts'))}</p>"
    return f"<ul class='doubts'>{''.join(rows)}</ul>"


def _contest(bench: Bench, found: dict[str, Any]) -> str:
    say, view = bench.say, bench.view
    rows = [
        (
            escape(_method(bench, each["method"])),
            view.error(each["mean_m"]) if each["mean_m"] is not None else "–",
            view.error(each["max_m"]) if each["max_m"] is not None else "–",
            f"{100 * each['coverage']:.0f} %" if each["coverage"] is not None else "–",
        )
        for each in found["table"]
    ]
    columns = [
        say("calibration.method"),
        f"{say('calibration.mean')} {view.unit_name}",
        f"{say('calibration.max')} {view.unit_name}",
        say("calibration.in_region"),
    ]
    marks = ['class="chosen"' if e["method"] == found["winner"] else "" for e in found["table"]]
    return (
        f"<h2>{escape(say('calibration.contest'))}</h2>"
        f"{table(columns, rows, attributes=marks, mark='contest')}"
        f"<p class='note'>{escape(found['rule'])}</p>"
    )


def _joints(bench: Bench, found: dict[str, Any]) -> str:
    say = bench.say
    names = list(found["stiffness"] or found["drives"])
    rows = []
    for name in names:
        stiff, drive = found["stiffness"].get(name), found["drives"].get(name)
        rows.append(
            (
                escape(name.replace("joint ", "")),
                f"{stiff['Nm_per_rad']:.3g}" if stiff else "–",
                f"{stiff['sd_Nm_per_rad']:.1g}" if stiff else "–",
                f"{drive['ripple_mdeg']:.2f}" if drive else "–",
                f"{drive['backlash_mdeg']:.2f}" if drive else "–",
            )
        )
    columns = [
        say("calibration.joint"), say("calibration.stiffness"), "±", say("calibration.ripple"),
        say("calibration.backlash"),
    ]  # fmt: skip
    return f"<h2>{escape(say('calibration.joints'))}</h2>{table(columns, rows, mark='joints')}"


async def _certificate(bench: Bench, model: ModelRecord) -> None:
    """The certificate of a model; poses it has not seen make it worth more."""
    workspace = bench.house.workspace
    used = {each.id for each in model.refs("data")}
    found = (await bench.ask(items.search, workspace, MEASUREMENT, ItemQuery(limit=50))).items
    unseen = [each for each in found if each.id not in used]
    fields = report_form(bench, "measurements", "tolerance_mm", sets=unseen)
    await reports(bench, model, "model", page=f"/calibration?model={model.id}", fields=fields)


async def _new(bench: Bench) -> None:
    """The form that asks for a calibration."""
    say, workspace = bench.say, bench.house.workspace
    cells = (await bench.ask(items.search, workspace, CELL, ItemQuery(limit=50))).items
    sets = (await bench.ask(items.search, workspace, MEASUREMENT, ItemQuery(limit=100))).items
    if not cells or not sets:
        html(f"<p>{escape(say('calibration.needs'))}</p>").classes("card")
        return
    form = RequestForm(
        bench=bench,
        request=CalibrateRequest,
        group="calibration",
        records={"cell": cells, "measurement": sets},
        marks={"measurements": "pick-set", "method": "method"},
    )
    picks, *others = (
        form.control(each)
        for each in sorted(fields_of(CalibrateRequest), key=lambda each: not each.many)
        if each.is_in(FORM)
    )
    html(
        f"<h2>{escape(say('calibration.new'))}</h2>"
        "<form onsubmit=\"return bench.jobForm('calibrate',this)\" data-testid='calibrate-form'>"
        f"<div class='columns'><div class='picks'>{picks}</div><div style='display:grid;gap:12px'>"
        f"{''.join(others)}{form.name_field()}"
        f"<button class='act' data-testid='calibrate'>{escape(say('calibration.start'))}</button>"
        "</div></div></form>"
    ).classes("card")


async def _others(bench: Bench) -> None:
    say = bench.say
    found = await bench.ask(items.search, bench.house.workspace, MODEL, ItemQuery(limit=50))
    if len(found.items) < 2:
        return
    rows = [
        (
            f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
            escape(_method(bench, each.method)),
            f"{each.detail.get('rows', 0):,}",
            when(each.created),
        )
        for each in found.items
    ]
    links = [link_to(f"/calibration?model={each.id}") for each in found.items]
    columns = [
        say("measurements.name"), say("calibration.method"), say("measurements.poses"),
        say("measurements.taken"),
    ]  # fmt: skip
    title = escape(say("calibration.others"))
    shown = table(columns, rows, words=(0, 1), attributes=links, mark="models")
    html(f"<h2>{title}</h2>{shown}").classes("card")


PAGE: Final = Page(name="calibration", path="/calibration", build=_build)
