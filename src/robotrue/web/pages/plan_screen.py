"""Plans: which poses to measure, what to expect of them, how the instrument sees them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from robotrue.app.plan_request import PlanRequest
from robotrue.app.workbench import workbench_calls as calls
from robotrue.core.document_decoder import decode
from robotrue.report.words import ReportTexts
from robotrue.store.nouns import CELL, DOCUMENT, MODEL, PROGRAM, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.curve import Line, curve
from robotrue.web.parts.request_form import RequestForm

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
    "more than requested": "more",
}
BODIES: Final = {"collision with ": "collision", "line of sight: ": "sight"}


async def _build(context: PageContext) -> str:
    if context.query.get("id") is not None:
        return context.render("plan.html", record=await _record(context))
    cells = await context.items(CELL, ItemQuery(limit=50))
    models = await context.items(MODEL, ItemQuery(limit=50))
    form = RequestForm(
        context=context,
        request=PlanRequest,
        group="plan",
        records={"cell": cells, "model": models},
        marks={"model": "start-from", "poses": "plan-poses", "krl": "plan-krl"},
        without=frozenset({"region", "program", "within"}),
    )
    programs = await context.items(PROGRAM, ItemQuery(limit=100))
    return context.render(
        "plans.html",
        jobs=await context.jobs(KIND),
        cells=cells,
        programs=[{"id": each.id, "name": each.name} for each in programs],
        plain=form.fields(advanced=False) + form.name_field(),
        advanced=form.fields(advanced=True),
        plans=await context.items(DOCUMENT, ItemQuery(where={"kind": KIND}, limit=100)),
    )


async def _record(context: PageContext) -> DocumentRecord:
    return await context.item(DOCUMENT, context.query["id"])


async def _show_promise(context: PageContext) -> str:
    """Expected accuracy of a plan, and the instrument's view of its poses."""
    record = await _record(context)
    found = await context.answer(calls.show_plan, record.id, record.version)
    words = ReportTexts(lang="zh" if context.say.language == "zh" else "en")
    return context.render(
        "plan_shown.html",
        found=found,
        scene=f"/api/plans/{record.id}?version={record.version}",
        curve=_curve(context, found),
        rejected=[(_reason(context, name), count) for name, count in found["rejected"].items()],
        notes=[words.sentence(each) for each in found["notes"]],
        several=len(found["loads"]) > 1,
        seen=found["visibility"],
    )


@dataclass(frozen=True, slots=True)
class _PlanCurve:
    """Expected mean error over the number of poses, mm."""

    poses: int
    expected_mean_mm: list[float]
    random_mean_mm: list[float]
    random_low_mm: list[float]
    random_high_mm: list[float]
    floor_mean_mm: float


def _curve(context: PageContext, stated: Mapping[str, object]) -> Markup:
    plan = decode(_PlanCurve, stated)
    say, view = context.say, context.view
    scale, first = 1e-3 / view.scale, min(FIRST, plan.poses)

    def part(values: list[float]) -> list[float]:
        return [scale * v for v in values[first:]]

    floor = say("plan.curve_floor", value=view.error(plan.floor_mean_mm * 1e-3))
    return curve(
        list(range(first, plan.poses + 1)),
        [
            Line(label=say("plan.curve_ours"), values=part(plan.expected_mean_mm)),
            Line(
                label=say("plan.curve_random"),
                values=part(plan.random_mean_mm),
                low=part(plan.random_low_mm),
                high=part(plan.random_high_mm),
                look="other",
            ),
        ],
        title=say("plan.curve"),
        across=say("plan.curve_across"),
        up=say("plan.curve_up").replace("mm", view.unit_name),
        floor=(scale * plan.floor_mean_mm, floor.replace("mm", view.unit_name)),
    )


def _reason(context: PageContext, name: str) -> str:
    if name in REASONS:
        return context.say(f"plan.reason_{REASONS[name]}")
    for start, key in BODIES.items():
        if name.startswith(start):
            return context.say(f"plan.reason_{key}", body=name.removeprefix(start))
    return name


BUILDS: Final = {"": _build, "shown": _show_promise}
