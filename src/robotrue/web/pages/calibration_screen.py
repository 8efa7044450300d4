"""The calibration: started, watched, and what it learned, how surely, and what it could not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.app.operations.calibrate import CalibrateRequest
from robotrue.app.request import fields_of
from robotrue.app.workbench import workbench_calls as calls
from robotrue.report.words import ReportTexts
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, ModelRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.reports import Reports, find_reports
from robotrue.web.parts.request_form import RequestForm
from robotrue.web.parts.residuals import draw_residuals

KNOWN: Final[Mapping[str, str]] = {"seen": "good", "weakly seen": "caution", "prior only": "bad"}


async def _build(context: PageContext) -> str:
    return context.render(
        "calibration.html",
        jobs=await context.jobs("calibrate"),
        model=context.model,
        reports=None if context.model is None else await _certificate(context, context.model),
        missing=await _find_missing_page(context),
        **await _form(context),
        models=await context.items(MODEL, ItemQuery(limit=50)),
    )


async def _certificate(context: PageContext, model: ModelRecord) -> Reports:
    """The certificates of a model; with unseen poses one is more meaningful."""
    used = {each.id for each in model.refs("data")}
    found = await context.items(MEASUREMENT, ItemQuery(limit=50))
    unseen = [each for each in found if each.id not in used]
    return await find_reports(context, model, "model", "measurements", "tolerance_mm", sets=unseen)


async def _find_missing_page(context: PageContext) -> str:
    """The page to go to first; empty: there is a cell and there are poses."""
    for stage, page in (("setup", "cell"), ("measure", "measurements")):
        if not context.stages[stage]:
            return page
    return ""


async def _form(context: PageContext) -> dict[str, object]:
    """The fields of a calibration; the set of the address is picked, else the newest."""
    cells = await context.items(CELL, ItemQuery(limit=50))
    sets = await context.items(MEASUREMENT, ItemQuery(limit=100))
    picked = context.query.get("measurements", sets[0].id if sets else "")
    form = RequestForm(
        context=context,
        request=CalibrateRequest,
        group="calibration",
        records={"cell": cells, "measurement": sets},
        marks={"measurements": "pick-set", "method": "method", "table": "table"},
        values={"measurements": picked},
        without=frozenset({"measurements"}),
    )
    (picked_from,) = (each for each in fields_of(CalibrateRequest) if each.name == "measurements")
    return {
        "picks": form.control(picked_from),
        "plain": form.fields(advanced=False) + form.name_field(),
        "advanced": form.fields(advanced=True),
    }


async def _show_learned(context: PageContext) -> str:
    """Shows the learned parameters of the page's model."""
    model = context.model
    if model is None:
        return ""
    found = await context.answer(calls.show_model, model.id, model.version)
    spans: dict[str, float] = {}
    for row in found["parameters"].values():
        size = abs(row["value"] or 0.0) + 2.0 * (row["sd"] or 0.0)
        spans[row["unit"]] = max(spans.get(row["unit"], 0.0), size)
    return context.render(
        "calibration_learned.html",
        model=model,
        found=found,
        spans=spans,
        known=KNOWN,
        sentence=ReportTexts(lang="zh" if context.say.language == "zh" else "en").sentence,
    )


async def _show_residuals(context: PageContext) -> str:
    """Errors of the newest held-out poses, before and after; without them, of poses of the fit."""
    model = context.model
    if model is None:
        return ""
    used = {to.id for to in model.refs("data")}
    own = {to.id for to in model.refs("cell")}
    found = await context.items(MEASUREMENT, ItemQuery(limit=50))
    of_cell = [each for each in found if own & {to.id for to in each.refs("cell")}]
    sets = sorted(of_cell, key=lambda each: each.id in used)
    if not sets:
        return ""
    versions = (sets[0].id, sets[0].version, model.id, model.version)
    seen = await context.answer(calls.judge_measurement, *versions)
    return context.render(
        "calibration_residuals.html",
        set=sets[0],
        seen=seen,
        residuals=draw_residuals(context, seen["poses"], seen["sizes"]),
    )


BUILDS: Final = {"": _build, "learned": _show_learned, "residuals": _show_residuals}
