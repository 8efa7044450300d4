"""The form that asks for a plan: what most people state in sight, the rest behind one press."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from nicegui import ui

from robotrue.app.operations.plan import PlanRequest
from robotrue.store.records import ItemRecord
from robotrue.web.bench import Bench
from robotrue.web.parts.frame import html
from robotrue.web.parts.region import RegionField
from robotrue.web.parts.request_form import RequestForm


def form(
    bench: Bench,
    cells: Sequence[ItemRecord],
    models: Sequence[ItemRecord],
    programs: Sequence[ItemRecord],
) -> None:
    """Builds the form in a card of its own."""
    say = bench.say
    made = RequestForm(
        bench=bench,
        request=PlanRequest,
        group="plan",
        records={"cell": cells, "model": models},
        marks={"model": "start-from", "poses": "plan-poses", "krl": "plan-krl"},
        without=frozenset({"region", "program", "within"}),
    )
    with ui.element("div").classes("card"):
        html(f"<h2>{escape(say('plan.new'))}</h2>").style("margin-bottom:10px")
        with (
            ui.element("form")
            .props('data-testid="plan-form"')
            .props("onsubmit=\"return bench.jobForm('plan',this)\"")
        ):
            with ui.element("div").classes("asks"):
                html(made.fields(advanced=False) + made.name_field()).style("display:contents")
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
            more = f"<div class='asks'>{made.fields(advanced=True)}</div>"
            html(f"<summary>{escape(say('plan.more'))}</summary>{more}", tag="details").classes(
                "more"
            )
            html(
                f"<button class='act' data-testid='plan-start'>{escape(say('plan.start'))}</button>"
            ).classes("go-row")
