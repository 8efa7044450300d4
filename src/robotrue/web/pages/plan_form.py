"""The form that asks for a plan: what most people state in sight, the rest behind one press."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from nicegui import ui

from robotrue.store.records import Record
from robotrue.web.bench import Bench
from robotrue.web.parts.frame import html
from robotrue.web.parts.region import RegionField

POSES: Final = 30
CANDIDATES: Final = 2000
SEED: Final = 1
TRIGGER: Final = 17


def form(
    bench: Bench, cells: Sequence[Record], models: Sequence[Record], programs: Sequence[Record]
) -> None:
    """Builds the form in a card of its own."""
    say = bench.say
    with ui.element("div").classes("card"):
        html(f"<h2>{escape(say('plan.new'))}</h2>").style("margin-bottom:10px")
        with (
            ui.element("form")
            .props('data-testid="plan-form"')
            .props("onsubmit=\"return bench.jobForm('plan',this)\"")
        ):
            with ui.element("div").classes("asks"):
                html(_subject(bench, cells, models)).style("display:contents")
                RegionField(
                    bench,
                    "region",
                    title=say("plan.work"),
                    anywhere=say("plan.work_any"),
                    programs=programs,
                )
                RegionField(
                    bench, "within", title=say("plan.within"), anywhere=say("plan.within_any")
                )
            html(
                f"<summary>{escape(say('plan.more'))}</summary>{_rest(bench)}", tag="details"
            ).classes("more")
            html(
                f"<button class='act' data-testid='plan-start'>{escape(say('plan.start'))}</button>"
            ).classes("go-row")


def _subject(bench: Bench, cells: Sequence[Record], models: Sequence[Record]) -> str:
    say = bench.say
    known = f'<option value="">{escape(say("plan.from_nothing"))}</option>' + _options(models)
    return (
        _field(say("plan.cell"), f'<select name="cell">{_options(cells)}</select>')
        + _field(
            say("plan.start_from"),
            f'<select name="model" data-testid="start-from">{known}</select>',
        )
        + _field(
            say("plan.poses"),
            f'<input type="number" name="poses" value="{POSES}" min="4" max="500" required '
            'data-testid="plan-poses">'
            f"<span>{escape(say('plan.poses_hint'))}</span>",
        )
        + _field(say("plan.name"), '<input type="text" name="name" maxlength="200">')
    )


def _rest(bench: Bench) -> str:
    say = bench.say
    criteria = "".join(
        f'<option value="{c}">{c}: {escape(say(f"plan.criterion_{c.lower()}"))}</option>'
        for c in ("I", "D")
    )
    approaches = "".join(
        f'<option value="{value}">{escape(say(f"plan.approach_{key}"))}</option>'
        for key, value in (("one_side", "one-side"), ("as_it_comes", "as-it-comes"))
    )

    def number(name: str, value: float, low: int, high: int, step: str = "1") -> str:
        return (
            f'<input type="number" name="{name}" value="{value:g}" min="{low}" max="{high}" '
            f'step="{step}">'
        )

    loads = '<input type="text" name="payloads[]" placeholder="50, 0, 0, 120" maxlength="60">'
    return (
        "<div class='asks'>"
        + _field(say("plan.criterion"), f'<select name="criterion">{criteria}</select>')
        + _field(say("plan.approach"), f'<select name="approach">{approaches}</select>')
        + _field(say("plan.candidates"), number("candidates", CANDIDATES, 10, 50_000))
        + _field(say("plan.tolerance"), number("tolerance_um", 0, 0, 1000, "any"))
        + _field(say("plan.seed"), number("seed", SEED, 0, 10**6))
        + _field(say("plan.payloads"), loads + loads)
        + f"<label class='tick'><input type='checkbox' name='krl' data-testid='plan-krl'>"
        f"{escape(say('plan.krl'))}</label>"
        + _field(say("plan.trigger_output"), number("trigger_output", TRIGGER, 1, 8192))
        + "</div>"
    )


def _field(label: str, control: str) -> str:
    return f"<label class='field'>{escape(label)}{control}</label>"


def _options(records: Sequence[Record]) -> str:
    return "".join(f'<option value="{each.id}">{escape(each.name)}</option>' for each in records)
