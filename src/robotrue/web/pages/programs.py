"""Programs: dropped, judged by predicted errors, compensated, downloaded."""

from __future__ import annotations

from html import escape
from typing import Any, Final

from nicegui import ui

from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.request import fields_of
from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import PROGRAM, ProgramRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import (
    Tile,
    delete_button,
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
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.later import later
from robotrue.web.parts.naming import heading, record_mark
from robotrue.web.parts.reports import report_form, reports
from robotrue.web.parts.request_form import RequestForm
from robotrue.web.parts.scene import SceneView

TOLERANCE_MM: Final = 0.5
AFTER: Final = "after"
"""Stage of a compensated program; ``store.programs`` would bring all readers with it."""
NOTES: Final = 8
"""Of compensating that are shown."""
STATES: Final = {"conforms": "good", "undecided": "caution", "fails": "bad", "unknown": "plain"}


async def _build(bench: Bench) -> None:
    asked = bench.query.get("id")
    if asked is None:
        await _list(bench)
        return
    try:
        record = await bench.ask(items.get, bench.house.workspace, PROGRAM, asked)
    except ConfigurationError as error:
        html(not_found(bench.say, error))
        return
    await _one(bench, record)


async def _list(bench: Bench) -> None:
    say = bench.say
    html(
        f"<h1>{escape(say('nav.programs'))}</h1><p class='lead'>{escape(say('programs.lead'))}</p>"
    ).classes("head")
    DropZone(
        bench,
        title=say("programs.drop"),
        hint=say("programs.drop_hint"),
        accept="",
        then="/api/programs",
        go=bench.kept("/programs?id={id}"),
    )
    found = await bench.ask(items.search, bench.house.workspace, PROGRAM, ItemQuery(limit=200))
    if not found.items:
        return
    begun = await bench.ask(
        items.read_creation_times, bench.house.workspace, [each.id for each in found.items]
    )
    rows, links = [], []
    for each in found.items:
        after = each.stage == AFTER
        stage = say("programs.stage_after" if after else "programs.stage_before")
        rows.append(
            (
                f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
                tag(stage, "good" if after else "plain"),
                escape(each.dialect),
                f"{each.bytes / 1e3:,.1f} kB",
                when(begun[each.id]),
            )
        )
        links.append(link_to(bench.kept(f"/programs?id={each.id}")))
    columns = [say(f"programs.{c}") for c in ("name", "stage", "language", "size", "taken")]
    html(table(columns, rows, words=(0, 1, 2), attributes=links, mark="programs")).classes(
        "card"
    ).style("margin-top:14px")


async def _one(bench: Bench, record: ProgramRecord) -> None:
    say = bench.say
    after = record.stage == AFTER
    model = bench.model
    acts = (
        undo_button(say("history.undo"), "program", record.id, record.version)
        if record.deleted
        else delete_button(say("frame.delete"), "program", record.id, "/programs")
    )
    acts += _downloads(bench, record)
    if not after and not record.deleted and model is not None:
        acts += _compensate_form(bench, record.id, model.id)
    stage = say("programs.stage_after" if after else "programs.stage_before")
    gone = tag(say("history.action_deleted"), "caution") if record.deleted else ""
    html(
        f"{heading(bench, 'program', record)}{tag(stage, 'good' if after else 'plain')}{gone}"
        f"<span class='note'>{escape(record.dialect)}, {when(record.created)}</span>"
        f"<div class='acts'>{acts}</div>"
    ).classes("head")
    if not after:
        for job in await bench.ask(under_way, bench.house.workspace, "compensate"):
            if job.parameters.get("program") == record.id:
                JobCard(
                    bench,
                    job,
                    title=say("programs.compensating"),
                    go="/programs?id={id}",
                    field="program",
                )
    if after and record.detail.get("notes"):
        html(_left(bench, record)).classes("card").props('data-testid="left-as-it-was"')
    if model is None:
        html(f"<p>{escape(say('programs.no_model'))}</p>").classes("card")
        return
    _judged(bench, record, model.id)
    if after and record.refs("model"):
        page = f"/programs?id={record.id}&tolerance_mm={_tolerance(bench):g}"
        await reports(bench, record, "program", page=page, fields=_report_fields(bench))


def _compensate_form(bench: Bench, program: str, model: str) -> str:
    form = RequestForm(
        bench=bench,
        request=CompensateRequest,
        group="programs",
        records={},
        marks={"allow_steps": "allow-steps"},
    )
    (box,) = [form.control(each) for each in fields_of(form.request) if each.name == "allow_steps"]
    return (
        "<form style='display:contents' onsubmit=\"return bench.jobForm('compensate',this)\">"
        f'<input type="hidden" name="program" value="{program}">'
        f'<input type="hidden" name="model" value="{model}">'
        f'<button class="act" data-testid="compensate">{escape(bench.say("programs.compensate"))}'
        f"</button>{box}</form>"
    )


def _left(bench: Bench, record: ProgramRecord) -> str:
    """What compensating says of lines it left as they were: why a verdict is what it is."""
    say, notes = bench.say, [str(each) for each in record.detail["notes"]]
    listed = "".join(f"<li>{escape(each)}</li>" for each in notes[:NOTES])
    more = f"<li>{escape(say('programs.more', count=len(notes) - NOTES))}</li>"
    title = say("programs.left", count=record.detail["compensated"], of=record.detail["targets"])
    return (
        f"<h2>{escape(title)}</h2><ul class='doubts note' lang='en'>{listed}"
        f"{more if len(notes) > NOTES else ''}</ul>"
    )


def _judged(bench: Bench, record: ProgramRecord, model: str) -> None:
    tolerance, strict = _tolerance(bench), _strict(bench)
    house = bench.house
    folder = str(house.workspace.folder)
    version = bench.model.version if bench.model is not None else 1

    async def ask() -> bytes:
        return await house.answers.once(
            "program.judged", folder, record.id, record.version, model, version, tolerance, strict
        )

    source = (
        f"/api/programs/{record.id}/judgement?model={model}&tolerance_mm={tolerance:g}"
        f"&version={record.version}{'&strict=true' if strict else ''}"
    )
    later(bench, ask, lambda found: _show(bench, record, found, source, tolerance))


def _show(
    bench: Bench, record: ProgramRecord, found: dict[str, Any], source: str, tolerance: float
) -> None:
    say, view = bench.say, bench.view
    html(_verdict(bench, record, found, tolerance)).classes(
        f"card verdict {'good' if found['go'] else 'bad'}"
    ).props('data-testid="verdict"')
    before, after = found["before_m"], found["after_m"]
    changed = record.stage == AFTER

    def tile(name: str) -> Tile:
        was = f"{say('scene.before')} {view.error(before[name])} {view.unit_name}"
        return Tile(
            label=say(f"programs.error_{name}"),
            value=view.error(after[name]),
            unit=view.unit_name,
            was=was if changed else "",
        )

    html(
        tiles(
            [
                tile("mean"),
                tile("p95"),
                tile("max"),
                Tile(
                    label=say("programs.bound"),
                    value=view.error(found["bound_m"]),
                    unit=view.unit_name,
                ),
                Tile(label=say("programs.targets"), value=f"{found['targets']:,}"),
            ]
        )
    ).classes("tiles")
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("card"):
            SceneView(bench, source)
        html(f"<h2>{escape(say('programs.worst'))}</h2>{_worst(bench, found)}").classes("card")


def _verdict(bench: Bench, record: ProgramRecord, found: dict[str, Any], tolerance: float) -> str:
    say = bench.say
    states = found["states"]
    not_proven = found["targets"] - states["conforms"]
    text = (
        say("programs.go", targets=found["targets"])
        if found["go"]
        else say("programs.no_go", count=not_proven, targets=found["targets"])
    )
    simulated = simulated_mark(say, found["simulated"])
    rule = say("programs.rule", model=found["model"]["name"])
    if record.stage == AFTER:
        rule += " " + say("programs.rule_after")
    if found["axis_targets"]:
        key = "programs.axis_strict" if found["strict"] else "programs.axis_apart"
        rule += " " + say(key, count=found["axis_targets"])
    return (
        f"<b>{'GO' if found['go'] else 'NO-GO'}</b><div><div>{escape(text)}{simulated}</div>"
        f'<div class="note">{escape(rule)}</div></div>'
        '<form style="margin-left:auto;display:flex;gap:8px;align-items:end" method="get">'
        f'<input type="hidden" name="id" value="{record.id}">{model_field(bench)}'
        '<label class="field">'
        f"{escape(say('programs.tolerance'))}"
        f'<input type="number" name="tolerance_mm" min="0.001" step="any" value="{tolerance:g}" '
        'style="width:110px" data-testid="tolerance"></label>'
        f"{_strictness(bench, found)}"
        f'<button class="act quiet">{escape(say("programs.judge"))}</button></form>'
    )


def _strictness(bench: Bench, found: dict[str, Any]) -> str:
    """A box for the strict rule, where there are targets it would change."""
    if not found["axis_targets"]:
        return ""
    checked = " checked" if found["strict"] else ""
    return (
        '<label class="note" style="display:flex;gap:8px;align-items:center;min-height:44px;'
        'white-space:nowrap">'
        f'<input type="checkbox" name="strict" data-testid="strict"{checked}>'
        f"{escape(bench.say('programs.strict'))}</label>"
    )


def _worst(bench: Bench, found: dict[str, Any]) -> str:
    say, view = bench.say, bench.view
    compared = found["scene"]["path"]["compared"]
    columns = [
        say("programs.line"),
        *([f"{say('scene.before')} {view.unit_name}"] if compared else []),
        f"{say('scene.after') if compared else say('programs.error')} {view.unit_name}",
        f"± 95 % {view.unit_name}",
        "",
    ]
    rows = [
        (
            str(each["line"]),
            *([_length(bench, each["before_m"])] if compared else []),
            _length(bench, each["after_m"]),
            _length(bench, each["bound_m"]),
            tag(say(f"programs.state_{each['state']}"), STATES[each["state"]]),  # type: ignore[arg-type]
        )
        for each in found["worst"]
    ]
    links = [f'data-point="{each["point"]}" tabindex="0"' for each in found["worst"]]
    return table(columns, rows, words=(0, len(columns) - 1), attributes=links, mark="worst")


def _length(bench: Bench, value: float | None) -> str:
    """An error as printed; a target of which nothing is known has none."""
    return "–" if value is None else bench.view.error(value)


def _report_fields(bench: Bench) -> str:
    """The report is judged by the tolerance and the rule that stand on the page."""
    strict = "<input type='checkbox' name='strict' checked hidden>" if _strict(bench) else ""
    return report_form(bench, "tolerance_mm", tolerance_mm=_tolerance(bench)) + strict


def _downloads(bench: Bench, record: ProgramRecord) -> str:
    return "".join(
        f'<a class="act quiet" data-testid="download" download '
        f'href="/api/items/program/{record.id}/files/{each.sha256}?version={record.version}">'
        f"{icon('download')}{escape(each.name)}</a>"
        for each in record.files("program")
    )


def _strict(bench: Bench) -> bool:
    return bench.query.get("strict") == "on"


def _tolerance(bench: Bench) -> float:
    try:
        stated = float(bench.query.get("tolerance_mm", TOLERANCE_MM))
    except ValueError:
        return TOLERANCE_MM
    return stated if 0.0 < stated <= 1000.0 else TOLERANCE_MM


PAGE: Final = Page(name="programs", path="/programs", build=_build)
