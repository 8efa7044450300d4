"""Plans: which poses to measure, what to expect of them, how the instrument sees them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, Final

from nicegui import ui

from robotrue import __version__
from robotrue.errors import ConfigurationError
from robotrue.report.words import ReportTexts
from robotrue.store import items
from robotrue.store.nouns import CELL, DOCUMENT, MODEL, PROGRAM, DocumentRecord
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.web.bench import Bench, Page
from robotrue.web.pages.plan_form import form
from robotrue.web.parts.curve import Line, curve
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import (
    Tile,
    delete_button,
    link_to,
    simulated_mark,
    table,
    tiles,
    when,
)
from robotrue.web.parts.faults import not_found
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.later import later
from robotrue.web.parts.naming import record_mark
from robotrue.web.parts.scene import SceneView

KIND: Final = "plan"
FIRST: Final = 4
"""Poses from which the curve is drawn: fewer do not fix base and tool."""
REASONS: Final = {
    "joint limits": "joint_limits",
    "self collision": "self_collision",
    "line of sight: the arm": "sight_arm",
    "acceptance angle of the reflector": "acceptance",
    "pre-position at a limit": "pre_limit",
    "pre-position in collision": "pre_collision",
    "outside the region": "region",
    "more than asked for": "more",
}
BODIES: Final = {"collision with ": "collision", "line of sight: ": "sight"}


async def _build(bench: Bench) -> None:
    ui.add_head_html(f'<link rel="stylesheet" href="/static/plan.css?v={__version__}">')
    asked = bench.query.get("id")
    if asked is None:
        await _list(bench)
        return
    try:
        record = await bench.ask(items.get, bench.house.workspace, DOCUMENT, asked)
    except ConfigurationError as error:
        html(not_found(bench.say, error))
        return
    _one(bench, record)


async def _list(bench: Bench) -> None:
    say, workspace = bench.say, bench.house.workspace
    html(
        f"<h1>{escape(say('plan.title'))}</h1><p class='lead'>{escape(say('plan.lead'))}</p>"
    ).classes("head")
    for job in await bench.ask(under_way, workspace, KIND):
        JobCard(bench, job, title=say("plan.running"), go="/plan?id={id}", field="document")
    cells = (await bench.ask(items.search, workspace, CELL, ItemQuery(limit=50))).items
    if not cells:
        html(f"<p>{escape(say('plan.needs'))}</p>").classes("card")
        return
    models = (await bench.ask(items.search, workspace, MODEL, ItemQuery(limit=50))).items
    programs = (await bench.ask(items.search, workspace, PROGRAM, ItemQuery(limit=100))).items
    form(bench, cells, models, programs)
    asked = ItemQuery(where={"kind": KIND}, limit=100)
    _plans(bench, (await bench.ask(items.search, workspace, DOCUMENT, asked)).items)


def _plans(bench: Bench, found: Sequence[DocumentRecord]) -> None:
    say, view = bench.say, bench.view
    if not found:
        return
    rows = [
        (
            f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
            str(each.detail["poses"]),
            view.error(each.detail["expected_mean_mm"][-1] * 1e-3),
            escape(str(each.detail["criterion"])),
            when(each.created),
        )
        for each in found
    ]
    columns = [
        say("plan.name"), say("plan.poses"), f"{say('plan.expected')} {view.unit_name}",
        say("plan.of_worth"), say("measurements.taken"),
    ]  # fmt: skip
    links = [link_to(f"/plan?id={each.id}") for each in found]
    shown = table(columns, rows, attributes=links, mark="plans")
    html(f"<h2>{escape(say('plan.listed'))}</h2>{shown}").classes("card")


def _one(bench: Bench, record: DocumentRecord) -> None:
    say, house = bench.say, bench.house
    html(
        f"<h1>{escape(record.name)}</h1><span class='note'>{when(record.created)}</span>"
        f"<div class='acts'>{_acts(bench, record)}</div>"
    ).classes("head")

    async def ask() -> bytes:
        folder = str(house.workspace.folder)
        return await house.answers.once("plan.shown", folder, record.id, record.version)

    later(bench, ask, lambda found: _show(bench, record, found))
    html(f"<h2>{escape(say('plan.next'))}</h2>").style("margin-bottom:8px")
    DropZone(
        bench,
        title=say("plan.next_drop"),
        hint=say("plan.next_hint"),
        accept=".csv,.tsv,.txt,.xlsx,.xls,.ods",
        then="",
        go="/measurements?upload={id}",
    )


def _acts(bench: Bench, record: ItemRecord) -> str:
    out = delete_button(bench.say("frame.delete"), "document", record.id, "/plan")
    for each in record.attachments:
        where = f"{record.id}/{each.sha256}?version={record.version}"
        if each.name.endswith(".html"):
            out += (
                f'<a class="act quiet" target="_blank" href="/reports/document/{where}">'
                f"{escape(bench.say('plan.report'))}</a>"
            )
            continue
        file = f"/api/items/document/{record.id}/files/{each.sha256}?version={record.version}"
        out += (
            f'<a class="act quiet" download data-testid="download" href="{file}">'
            f"{icon('download')}{escape(each.name)}</a>"
        )
    return out


def _show(bench: Bench, record: ItemRecord, found: dict[str, Any]) -> None:
    say = bench.say
    html(tiles(_tiles(bench, found))).classes("tiles").props('data-testid="plan-tiles"')
    if found["simulated"]:
        html(simulated_mark(say, simulated=True))
    with ui.element("div").classes("columns"):
        with ui.element("div"):
            html(_curve(bench, found)).classes("card").props('data-testid="plan-curve"')
            with ui.element("div").classes("card"):
                SceneView(bench, f"/api/plans/{record.id}?version={record.version}")
        with ui.element("div"):
            html(f"<h2>{escape(say('plan.visibility'))}</h2>{_looked_at(bench, found)}").classes(
                "card"
            )
            html(f"<h2>{escape(say('plan.not_checked'))}</h2>{_notes(bench, found)}").classes(
                "card"
            ).props('data-testid="plan-notes"')
    html(
        f"<h2>{escape(say('plan.table'))}</h2>{_table(bench, found)}"
        f"<p class='note' style='margin-top:10px'>{escape(say('plan.table_text'))}</p>"
    ).classes("card")


def _tiles(bench: Bench, found: dict[str, Any]) -> list[Tile]:
    say, view = bench.say, bench.view
    n = found["poses"]

    def error(label: str, value_mm: float) -> Tile:
        return Tile(label=label, value=view.error(value_mm * 1e-3), unit=view.unit_name)

    return [
        Tile(
            label=say("plan.poses"),
            value=str(n),
            was=say("plan.stopped") if found["stopped"] else "",
        ),
        error(say("plan.expected"), found["expected_mean_mm"][n]),
        error(say("plan.random"), found["random_mean_mm"][n]),
        error(say("plan.floor"), found["floor_mean_mm"]),
        Tile(label=say("plan.travel"), value=f"{found['travel_deg']:,.0f}", unit="°"),
    ]


def _curve(bench: Bench, found: dict[str, Any]) -> str:
    say, view = bench.say, bench.view
    scale = 1e-3 / view.scale
    first = min(FIRST, found["poses"])

    def part(name: str) -> list[float]:
        return [scale * v for v in found[name][first:]]

    drawn = curve(
        list(range(first, found["poses"] + 1)),
        [
            Line(label=say("plan.curve_ours"), values=part("expected_mean_mm")),
            Line(
                label=say("plan.curve_random"),
                values=part("random_mean_mm"),
                low=part("random_low_mm"),
                high=part("random_high_mm"),
                look="other",
            ),
        ],
        title=say("plan.curve"),
        across=say("plan.curve_across"),
        up=say("plan.curve_up").replace("mm", view.unit_name),
        floor=(
            scale * found["floor_mean_mm"],
            say("plan.curve_floor", value=view.error(found["floor_mean_mm"] * 1e-3)).replace(
                "mm", view.unit_name
            ),
        ),
    )
    text = (
        say("plan.curve_text_model", model=found["model"])
        if found["model"]
        else say("plan.curve_text")
    )
    return (
        f"<h2>{escape(say('plan.curve'))}</h2>{drawn}"
        f"<p class='note' style='margin-top:8px'>{escape(text)}</p>"
    )


def _looked_at(bench: Bench, found: dict[str, Any]) -> str:
    say = bench.say
    rows = [(escape(say("plan.drawn")), f"{found['drawn']:,}")]
    rows += [
        (escape(_reason(bench, name)), f"−{count:,}") for name, count in found["rejected"].items()
    ]
    rows.append((f"<b>{escape(say('plan.kept'))}</b>", f"<b>{found['candidates']:,}</b>"))
    return table(["", ""], rows, mark="looked-at")


def _reason(bench: Bench, name: str) -> str:
    if name in REASONS:
        return bench.say(f"plan.reason_{REASONS[name]}")
    for start, key in BODIES.items():
        if name.startswith(start):
            return bench.say(f"plan.reason_{key}", body=name.removeprefix(start))
    return name


def _notes(bench: Bench, found: dict[str, Any]) -> str:
    words = ReportTexts(lang="zh" if bench.say.language == "zh" else "en")
    if not found["notes"]:
        return f"<p class='note'>{escape(bench.say('plan.all_checked'))}</p>"
    listed = "".join(f"<li>{escape(words.sentence(each))}</li>" for each in found["notes"])
    return f"<ul class='doubts'>{listed}</ul>"


def _table(bench: Bench, found: dict[str, Any]) -> str:
    say, seen = bench.say, found["visibility"]
    several = len(found["loads"]) > 1
    dof = len(found["joints_deg"][0])
    columns = [say("plan.pose"), *(f"j{k + 1} °" for k in range(dof)), "x mm", "y mm", "z mm"]
    columns += [say("plan.distance")] * (seen["distance_m"] is not None)
    columns += [say("plan.off_axis")] * (seen["angle_deg"] is not None)
    columns += [say("plan.load")] * several + [say("plan.worth")]
    rows = []
    for k, joints in enumerate(found["joints_deg"]):
        row = [str(k + 1), *(f"{q:.2f}" for q in joints)]
        row += [f"{x:.1f}" for x in found["commanded_mm"][k]]
        row += [] if seen["distance_m"] is None else [f"{seen['distance_m'][k]:.2f}"]
        row += [] if seen["angle_deg"] is None else [f"{seen['angle_deg'][k]:.0f}"]
        row += [f"{found['loads'][found['load'][k]]['mass_kg']:g} kg"] if several else []
        rows.append([*row, str(found["rank"][k] + 1)])
    marks = [f'data-point="{k}" tabindex="0"' for k in range(len(rows))]
    return table(columns, rows, attributes=marks, mark="poses")


PAGE: Final = Page(name="plan", path="/plan", build=_build)
