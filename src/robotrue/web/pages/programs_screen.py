"""Programs: uploaded, checked by predicted errors, compensated, downloaded."""

from __future__ import annotations

from typing import Final

from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.job_files import BLOCKS
from robotrue.app.request import FORM, fields_of
from robotrue.app.serve_defaults import LARGEST_DRAWN
from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import (
    CELL,
    PROGRAM,
    REGISTRATION,
    ModelRecord,
    ProgramRecord,
    RegistrationRecord,
)
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.changed_lines import SHOWN, list_changed_lines
from robotrue.web.parts.reports import Reports, find_reports
from robotrue.web.parts.request_form import RequestForm, name_options
from robotrue.web.parts.residuals import draw_along

AFTER: Final = "after"
"""Stage of a compensated program; ``store.programs`` would bring all readers with it."""
CHOSEN_BY_PAGE: Final = frozenset({"model", "program"})
PART_FIELDS: Final = frozenset({"registration", "part"})
"""Fields that need a registered part."""
OFFERED: Final = ("0.1", "0.2", "0.3", "0.5", "1")
"""Tolerances, mm, that one press states; none is assumed."""
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
        form=None if after or context.model is None else await _form(context, context.model),
        jobs=jobs,
        notes=[str(each) for each in record.detail.get("notes") or ()] if after else [],
        tables=name_options(
            record.detail.get(BLOCKS) or [],
            (
                each
                for each in fields_of(CompensateRequest)
                if each.is_in(FORM) and each.name not in CHOSEN_BY_PAGE
            ),
            lambda name: context.say(f"programs.{name}"),
        ),
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
    return context.render(
        "programs.html",
        programs=found,
        begun=begun,
        after=AFTER,
        part=await _part(context),
    )


async def _part(context: PageContext) -> RegistrationRecord | None:
    """The registered part that the page's address names, to compensate programs in it."""
    named = context.query.get("registration")
    return None if not named else await context.item(REGISTRATION, named)


async def _form(context: PageContext, model: ModelRecord) -> RequestForm:
    """The form of a compensation; part frames are offered that belong to its model."""
    parts = await context.items(REGISTRATION, ItemQuery(linked=("model", model.id), limit=100))
    cells = await context.items(CELL, ItemQuery(limit=50))
    return RequestForm(
        context=context,
        request=CompensateRequest,
        group="programs",
        records={"registration": parts, "cell": cells},
        marks={"allow_steps": "allow-steps", "registration": "part-frame", "part": "part-name"},
        without=CHOSEN_BY_PAGE if parts else CHOSEN_BY_PAGE | PART_FIELDS,
        values={"registration": context.query.get("registration", "")},
    )


async def _reports(context: PageContext, record: ProgramRecord) -> Reports | None:
    """The reports of a compensated program; one is checked against the tolerance on the page."""
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
        f"/api/programs/{record.id}/judgement?model={model.id}&version={record.version}"
        f"{'' if tolerance is None else f'&tolerance_mm={tolerance:g}'}"
        f"{'&strict=true' if strict else ''}"
    )
    compared = found["scene"]["path"]["compared"]
    return context.render(
        "program_judged.html",
        record=record,
        found=found,
        after=record.stage == AFTER,
        compared=compared,
        along=draw_along(context, found["along"], compared=compared),
        source=source,
        tolerance=tolerance,
        offered=OFFERED,
        tones=TONES,
    )


async def _list_changes(context: PageContext) -> str:
    """The first lines that compensation changed, with their old text."""
    record = await _record(context)
    links, made = record.refs("before"), record.files("program")
    if not links or not made:
        return ""
    before = (await context.item(PROGRAM, links[0].id, links[0].version)).files("program")
    same = [(old, new) for new in made for old in before if old.name == new.name]
    old, new = same[0] if same else (before[0], made[0])
    path_of = context.workspace.path_of
    was, now = [await context.ask(path_of, each.sha256) for each in (old, new)]
    changed = await context.ask(list_changed_lines, was, now)
    return context.render(
        "program_changes.html", changed=changed, most=SHOWN, read_mb=LARGEST_DRAWN / 1e6
    )


def _strict(context: PageContext) -> bool:
    return context.query.get("strict") == "on"


def _tolerance(context: PageContext) -> float | None:
    """Returns the tolerance in the address, mm; None: not stated, so there is no verdict."""
    return context.number("tolerance_mm", None, most=1000.0)


BUILDS: Final = {"": _build, "judged": _judge, "changes": _list_changes}
