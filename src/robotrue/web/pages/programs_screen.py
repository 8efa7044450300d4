"""Programs: dropped, judged by predicted errors, compensated, downloaded."""

from __future__ import annotations

from typing import Final

from markupsafe import Markup

from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.request import fields_of
from robotrue.app.workbench import workbench_calls as calls
from robotrue.program.compensation_defaults import TOLERANCE_MM
from robotrue.store.nouns import PROGRAM, ProgramRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext, Screen
from robotrue.web.parts.reports import Reports, find_reports
from robotrue.web.parts.request_form import RequestForm

AFTER: Final = "after"
"""Stage of a compensated program; ``store.programs`` would bring all readers with it."""
NOTES: Final = 8
"""Of compensating that are shown."""
TONES: Final = {"conforms": "good", "undecided": "caution", "fails": "bad", "unknown": "plain"}


async def _build(context: PageContext) -> str:
    if context.query.get("id") is None:
        return await _list(context)
    record = await _record(context)
    after = record.stage == AFTER
    jobs = [] if after else await context.jobs("compensate", program=record.id)
    return context.render(
        "program.html",
        record=record,
        after=after,
        model=context.model,
        allow_steps=_allow_steps(context),
        jobs=jobs,
        notes=[str(each) for each in record.detail.get("notes") or ()] if after else [],
        most=NOTES,
        reports=await _reports(context, record) if after else None,
        tolerance=_tolerance(context),
        strict=_strict(context),
    )


async def _record(context: PageContext) -> ProgramRecord:
    return await context.item(PROGRAM, context.query["id"])


async def _list(context: PageContext) -> str:
    found = await context.items(PROGRAM, ItemQuery(limit=200))
    begun = await context.creation_times(found)
    return context.render("programs.html", programs=found, begun=begun, after=AFTER)


def _allow_steps(context: PageContext) -> Markup:
    form = RequestForm(
        context=context,
        request=CompensateRequest,
        group="programs",
        marks={"allow_steps": "allow-steps"},
    )
    (box,) = [form.control(each) for each in fields_of(form.request) if each.name == "allow_steps"]
    return box


async def _reports(context: PageContext, record: ProgramRecord) -> Reports | None:
    """The reports of a compensated program; one is judged by the tolerance on the page."""
    if context.model is None or not record.refs("model"):
        return None
    tolerance = _tolerance(context)
    return await find_reports(context, record, "program", "tolerance_mm", tolerance_mm=tolerance)


async def _judge(context: PageContext) -> str:
    """Predicted errors of a program and GO or NO-GO."""
    record, model = await _record(context), context.model
    if model is None:
        return ""
    tolerance, strict = _tolerance(context), _strict(context)
    versions = (record.id, record.version, model.id, model.version)
    found = await context.answer(calls.judge_program, *versions, tolerance, strict)
    source = (
        f"/api/programs/{record.id}/judgement?model={model.id}&tolerance_mm={tolerance:g}"
        f"&version={record.version}{'&strict=true' if strict else ''}"
    )
    return context.render(
        "program_judged.html",
        record=record,
        found=found,
        after=record.stage == AFTER,
        compared=found["scene"]["path"]["compared"],
        source=source,
        tolerance=tolerance,
        tones=TONES,
    )


def _strict(context: PageContext) -> bool:
    return context.query.get("strict") == "on"


def _tolerance(context: PageContext) -> float:
    return context.number("tolerance_mm", TOLERANCE_MM, most=1000.0)


PAGE: Final = Screen(
    name="programs",
    path="/programs",
    build=_build,
    parts={"judged": _judge},
    operations=("compensate", "report"),
)
