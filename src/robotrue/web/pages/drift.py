"""The drift check: a few poses, a verdict on a model, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from nicegui import ui

from robotrue import __version__
from robotrue.app.operations.drift import DriftRequest
from robotrue.app.operations.drift_plan import DriftPlanRequest
from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import (
    DOCUMENT,
    DRIFT_CHECK,
    MEASUREMENT,
    MODEL,
    DriftCheckRecord,
    ModelRecord,
)
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.web.bench import Bench, Page
from robotrue.web.pages.drift_result import TONES, probability, result, verdict_word
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import link_to, table, tag, when
from robotrue.web.parts.faults import not_found
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.request_form import RequestForm

JOBS: Final = {
    "drift_plan": ("choosing", "/drift?model={model}&plan={id}", "document"),
    "drift": ("checking", "/drift?id={id}", "check"),
}
MODEL_FIELD: Final = frozenset({"model"})
"""Chosen for the whole page."""


async def _build(bench: Bench) -> None:
    ui.add_head_html(f'<link rel="stylesheet" href="/static/plan.css?v={__version__}">')
    asked = bench.query.get("id")
    if asked is None:
        await _overview(bench)
        return
    try:
        record = await bench.ask(items.get, bench.house.workspace, DRIFT_CHECK, asked)
        (model,) = record.refs("model")
        checked = await bench.ask(
            items.get, bench.house.workspace, MODEL, model.id, version=model.version
        )
    except ConfigurationError as error:
        html(not_found(bench.say, error))
        return
    await result(bench, record, checked)


async def _overview(bench: Bench) -> None:
    say, workspace, model = bench.say, bench.house.workspace, bench.model
    html(
        f"<h1>{escape(say('drift.title'))}</h1><p class='lead'>{escape(say('drift.lead'))}</p>"
    ).classes("head")
    if model is None:
        html(f"<p>{escape(say('drift.needs'))}</p>").classes("card")
        return
    await _choice(bench, model)
    for kind, (title, go, field) in JOBS.items():
        for job in await bench.ask(under_way, workspace, kind):
            if job.parameters.get("model") == model.id:
                address = go.replace("{model}", model.id)
                JobCard(bench, job, title=say(f"drift.{title}"), go=address, field=field)
    with ui.element("div").classes("columns even"):
        with ui.element("div"):
            await _poses(bench, model)
        with ui.element("div").classes("card"):
            await _measured(bench, model)
    await _history(bench, model)


async def _choice(bench: Bench, model: ModelRecord) -> None:
    found = (
        await bench.ask(items.search, bench.house.workspace, MODEL, ItemQuery(limit=100))
    ).items
    if len(found) < 2:
        return
    options = "".join(
        f'<option value="{each.id}"{" selected" if each.id == model.id else ""}>'
        f"{escape(each.name)} · {when(each.created)}</option>"
        for each in found
    )
    html(
        f"<form method='get'><label class='field'>{escape(bench.say('drift.model'))}"
        f"<select name='model' data-testid='drift-model' onchange='this.form.submit()' "
        f"style='max-width:520px'>{options}</select></label></form>"
    ).style("margin-bottom:14px")


async def _poses(bench: Bench, model: ModelRecord) -> None:
    """The check poses of this model, the newest first, and a form for new ones."""
    say = bench.say
    asked = ItemQuery(where={"kind": "drift-plan"}, linked=("model", model.id), limit=5)
    found = (await bench.ask(items.search, bench.house.workspace, DOCUMENT, asked)).items
    sheets = "".join(_sheet(bench, each) for each in found[:1])
    form = RequestForm(bench=bench, request=DriftPlanRequest, group="drift", without=MODEL_FIELD)
    html(
        f"<h2>{escape(say('drift.poses_title'))}</h2>"
        f"<p class='note'>{escape(say('drift.poses_text'))}</p>{sheets}"
        "<form class='row-form' data-testid='drift-plan-form' "
        "onsubmit=\"return bench.jobForm('drift_plan',this)\">"
        f"<input type='hidden' name='model' value='{model.id}'>"
        f"{form.fields(advanced=False)}"
        f"<button class='act{' quiet' if found else ''}' data-testid='drift-choose'>"
        f"{escape(say('drift.choose'))}</button></form>"
    ).classes("card")


def _sheet(bench: Bench, found: ItemRecord) -> str:
    say = bench.say
    where = f"/api/items/document/{found.id}/files"
    files = "".join(
        f'<a class="act" download data-testid="download" href="{where}/{each.sha256}'
        f'?version={found.version}">{icon("download")}{escape(each.name)}</a>'
        for each in found.attachments
    )
    joints = found.detail["joints_deg"]
    columns = ["", *(f"j{k + 1} °" for k in range(len(joints[0])))]
    rows = [(str(k + 1), *(f"{q:.1f}" for q in row)) for k, row in enumerate(joints)]
    return (
        f"<div class='head' style='margin:12px 0 8px'><h3>{escape(say('drift.sheet'))}</h3>"
        f"<span class='note'>{when(found.created)}</span><div class='acts'>{files}</div></div>"
        + table(columns, rows, mark="check-poses")
    )


async def _measured(bench: Bench, model: ModelRecord) -> None:
    say = bench.say
    html(f"<h2>{escape(say('drift.measured_title'))}</h2>").style("margin-bottom:10px")
    DropZone(
        bench,
        title=say("drift.drop"),
        hint=say("drift.drop_hint"),
        accept=".csv,.tsv,.txt,.xlsx,.xls,.ods",
        then="/api/drift-checks",
        go=f"/drift?model={model.id}&job={{id}}",
        facts={"model": model.id},
    )
    sets = (
        await bench.ask(items.search, bench.house.workspace, MEASUREMENT, ItemQuery(limit=50))
    ).items
    if not sets:
        return
    form = RequestForm(
        bench=bench,
        request=DriftRequest,
        group="drift",
        records={"measurement": sets},
        marks={"measurements": "drift-set"},
        without=MODEL_FIELD,
    )
    html(
        f"<form class='row-form' onsubmit=\"return bench.jobForm('drift',this)\">"
        f"<input type='hidden' name='model' value='{model.id}'>"
        f"{form.fields(advanced=False)}"
        f"<button class='act quiet' data-testid='drift-check'>{escape(say('drift.check'))}</button>"
        "</form>"
    )


async def _history(bench: Bench, model: ModelRecord) -> None:
    say = bench.say
    asked = ItemQuery(linked=("model", model.id), limit=200)
    found = (await bench.ask(items.search, bench.house.workspace, DRIFT_CHECK, asked)).items
    shown = (
        _checks(bench, found) if found else f"<p class='note'>{escape(say('drift.none_yet'))}</p>"
    )
    html(f"<h2>{escape(say('drift.history'))}</h2>{shown}").classes("card").props(
        'data-testid="drift-history"'
    )


def _checks(bench: Bench, found: Sequence[DriftCheckRecord]) -> str:
    say, view = bench.say, bench.view
    rows = [
        (
            when(each.created),
            tag(verdict_word(bench, each.verdict), TONES[each.verdict]),
            escape(each.name.partition(": ")[2] or each.name),
            str(each.poses),
            f"{each.statistic:.1f} / {each.detail['degrees_of_freedom']}",
            probability(each.p_value),
            view.error(each.detail["residual_rms_mm"] * 1e-3),
        )
        for each in found
    ]
    columns = [
        say("drift.when"), say("drift.verdict"), say("drift.data"), say("drift.poses"),
        say("drift.chi2"), say("drift.chance"), f"{say('drift.residual')} {view.unit_name}",
    ]  # fmt: skip
    links = [link_to(f"/drift?id={each.id}") for each in found]
    return table(columns, rows, words=(0, 1, 2), attributes=links, mark="checks")


PAGE: Final = Page(name="drift", path="/drift", build=_build)
