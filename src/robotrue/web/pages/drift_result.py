"""One drift check: its verdict, what may have moved, the residuals, and the next step."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from typing import Any, Final

from nicegui import ui

from robotrue.store.nouns import DriftCheckRecord, ModelRecord
from robotrue.web.bench import Bench
from robotrue.web.parts.elements import (
    Tile,
    Tone,
    delete_button,
    table,
    tag,
    tiles,
    when,
)
from robotrue.web.parts.frame import html
from robotrue.web.parts.job import JobCard, under_way
from robotrue.web.parts.naming import record_mark

TONES: Final[Mapping[str, Tone]] = {
    "keep": "good", "update": "caution", "recalibrate": "bad", "measure again": "caution",
}  # fmt: skip
MOST_CAUSES: Final = 5
LEAST_CHANCE: Final = 1e-4


async def result(bench: Bench, record: DriftCheckRecord, model: ModelRecord) -> None:
    """Builds the page of one check."""
    say, detail = bench.say, record.detail
    gone = delete_button(say("frame.delete"), "drift-check", record.id, f"/drift?model={model.id}")
    back = f"/drift?model={model.id}"
    html(
        f"<h1>{escape(record.name)}</h1><span class='note'>{when(record.created)}</span>"
        f"<div class='acts'>{gone}<a class='act quiet' href='{back}'>"
        f"{escape(say('drift.history'))}</a></div>"
    ).classes("head")
    for job in await bench.ask(under_way, bench.house.workspace, "transfer"):
        if job.parameters.get("model") == model.id:
            JobCard(
                bench,
                job,
                title=say("drift.updating"),
                go="/calibration?model={id}",
                field="model",
            )
    html(_verdict(bench, record)).classes(f"card verdict {TONES[record.verdict]}").props(
        'data-testid="drift-verdict"'
    )
    html(tiles(_tiles(bench, record))).classes("tiles")
    with ui.element("div").classes("columns"):
        with ui.element("div"):
            html(f"<h2>{escape(say('drift.moved'))}</h2>{_causes(bench, detail)}").classes("card")
            html(f"<h2>{escape(say('drift.table'))}</h2>{_residuals(bench, detail)}").classes(
                "card"
            )
        with ui.element("div"):
            html(_next(bench, record, model)).classes("card").props('data-testid="drift-next"')


def verdict_word(bench: Bench, verdict: str) -> str:
    """Returns a verdict in the user's language."""
    return bench.say(f"drift.verdict_{verdict.replace(' ', '_')}")


def probability(p: float) -> str:
    """Returns a probability as it is printed."""
    return f"< {LEAST_CHANCE:g}" if p < LEAST_CHANCE else f"{p:.2g}"


def _verdict(bench: Bench, record: DriftCheckRecord) -> str:
    say = bench.say
    means = say(f"drift.means_{record.verdict.replace(' ', '_')}")
    mark = record_mark(say, record)
    rule = say("drift.rule", level=f"{100 * record.detail['level']:g}")
    return (
        f"<b>{escape(verdict_word(bench, record.verdict))}</b><div><div>{escape(means)}{mark}</div>"
        f'<div class="note">{escape(rule)}</div></div>'
    )


def _tiles(bench: Bench, record: DriftCheckRecord) -> list[Tile]:
    say, view, detail = bench.say, bench.view, record.detail
    worst = max(detail["poses"], key=lambda each: _length(each["residual_mm"]))
    return [
        Tile(label=say("drift.poses"), value=str(record.poses)),
        Tile(
            label=f"{say('drift.chi2')}, {say('drift.per', degrees=detail['degrees_of_freedom'])}",
            value=f"{record.statistic:.1f}",
        ),
        Tile(label=say("drift.chance_text"), value=probability(record.p_value)),
        Tile(
            label=say("drift.residual"),
            value=view.error(detail["residual_rms_mm"] * 1e-3),
            unit=view.unit_name,
        ),
        Tile(
            label=f"{say('drift.worst')}, {say('drift.line')} {worst['line']}",
            value=view.error(_length(worst["residual_mm"]) * 1e-3),
            unit=view.unit_name,
        ),
    ]


def _causes(bench: Bench, detail: Mapping[str, Any]) -> str:
    say = bench.say
    unseen = ", ".join(_cause(bench, name, detail) for name in detail["not_seen"])
    hidden = f"<p class='note'>{escape(say('drift.not_seen', names=unseen))}</p>" if unseen else ""
    if detail["verdict"] == "keep":
        return f"<p>{escape(say('drift.moved_none'))}</p>{hidden}"
    rows = [
        (
            f"<span class='term'>{escape(_cause(bench, each['name'], detail))}</span>",
            _shift(each),
            probability(each["p"]),
            probability(each["p_left"]),
            tag(say("drift.explains"), "caution") if each["explains"] else "",
        )
        for each in detail["causes"][:MOST_CAUSES]
    ]
    columns = [
        say("drift.cause"), say("drift.shift"), say("drift.chance"), say("drift.chance_rest"), "",
    ]  # fmt: skip
    return table(columns, rows, words=(0, 1, 4), mark="causes") + hidden


def _cause(bench: Bench, name: str, detail: Mapping[str, Any]) -> str:
    kind, _, number = name.partition(" ")
    if kind == "reading":
        line = detail["poses"][int(number) - 1]["line"]
        return bench.say("drift.cause_reading", line=line)
    if kind == "joint":
        return bench.say("drift.cause_joint", number=number)
    return bench.say(f"drift.cause_{kind}")


def _shift(cause: Mapping[str, Any]) -> str:
    parts = []
    for key, value in cause["shift"].items():
        term, _, unit = key.rpartition("_")
        sd = cause["sd"][key]
        shown = "°" if unit == "deg" else f" {unit}"
        name = "" if term.startswith("theta") else f"{escape(term)} "
        parts.append(f"<span class='term'>{name}{value:+.4f} ± {sd:.4f}{shown}</span>")
    return " ".join(parts)


def _residuals(bench: Bench, detail: Mapping[str, Any]) -> str:
    say, view = bench.say, bench.view
    rows = [
        (
            str(each["line"]),
            *(view.error(1e-3 * v) for v in each["residual_mm"]),
            view.error(_length(each["residual_mm"]) * 1e-3),
            f"{each['sigmas']:.1f}",
        )
        for each in detail["poses"]
    ]
    columns = [
        say("drift.line"), *(f"{axis} {view.unit_name}" for axis in "xyz"),
        f"{say('drift.total')} {view.unit_name}", say("drift.of_sigma"),
    ]  # fmt: skip
    return table(columns, rows, mark="residuals")


def _length(vector: list[float]) -> float:
    return float(sum(v * v for v in vector) ** 0.5)


def _next(bench: Bench, record: DriftCheckRecord, model: ModelRecord) -> str:
    """What to do now, as buttons."""
    say = bench.say
    text = say(f"drift.next_{record.verdict.replace(' ', '_')}")
    again = f"<a class='act' href='/drift?model={model.id}'>{escape(say('drift.do_again'))}</a>"
    plan = f"<a class='act quiet' href='/plan'>{escape(say('drift.do_plan'))}</a>"
    calibrate = f"<a class='act' href='/calibration'>{escape(say('drift.do_calibrate'))}</a>"
    (data,) = record.refs("data")
    stated = escape(json.dumps({"model": model.id, "measurements": [data.id]}), quote=True)
    update = (
        f'<button class="act" data-testid="transfer" data-parameters="{stated}" '
        "onclick=\"bench.job('transfer',JSON.parse(this.dataset.parameters),this)\">"
        f"{escape(say('drift.do_update'))}</button>"
    )
    buttons = {
        "keep": "",
        "update": update + calibrate.replace("'act'", "'act quiet'"),
        "recalibrate": calibrate + plan,
        "measure again": again,
    }[record.verdict]
    return (
        f"<h2>{escape(say('drift.next'))}</h2><p>{escape(text)}</p>"
        f"<div class='row-form'>{buttons}</div>"
    )
