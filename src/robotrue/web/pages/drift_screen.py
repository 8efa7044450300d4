"""The drift check: a few poses, a verdict on a model, and what to do about it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from robotrue.app.operations.drift_checks import DriftPlanRequest, DriftRequest
from robotrue.core.document_decoder import decode
from robotrue.store.nouns import DOCUMENT, DRIFT_CHECK, MEASUREMENT, MODEL, ModelRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.request_form import RequestForm

JOBS: Final = {
    "drift_plan": ("choosing", "/drift?model={model}&plan={id}", "document"),
    "drift": ("checking", "/drift?id={id}", "check"),
}
MODEL_FIELD: Final = frozenset({"model"})
"""Chosen for the whole page."""
TONES: Final[Mapping[str, str]] = {
    "keep": "good", "update": "caution", "recalibrate": "bad", "measure again": "caution",
}  # fmt: skip
MOST_CAUSES: Final = 5
LEAST_CHANCE: Final = 1e-4


async def _build(context: PageContext) -> str:
    asked = context.query.get("id")
    if asked is not None:
        return await _result(context, asked)
    model = context.model
    if model is None:
        return context.render("drift.html", model=None)
    cards = []
    for kind, (title, go, field) in JOBS.items():
        jobs = await context.jobs(kind, model=model.id)
        cards.append((jobs, f"drift.{title}", go.replace("{model}", model.id), field))
    plans = await context.items(
        DOCUMENT, ItemQuery(where={"kind": "drift-plan"}, linked=("model", model.id), limit=5)
    )
    form = RequestForm(
        context=context, request=DriftPlanRequest, group="drift", without=MODEL_FIELD
    )
    return context.render(
        "drift.html",
        model=model,
        models=await context.items(MODEL, ItemQuery(limit=100)),
        cards=cards,
        plan=plans[0] if plans else None,
        plan_fields=form.fields(advanced=False),
        check_fields=await _check_fields(context),
        checks=await context.items(DRIFT_CHECK, ItemQuery(linked=("model", model.id), limit=200)),
        tones=TONES,
        probability=_probability,
    )


async def _check_fields(context: PageContext) -> Markup:
    """Fields to request a check of a stored set; none without a set."""
    sets = await context.items(MEASUREMENT, ItemQuery(limit=50))
    form = RequestForm(
        context=context,
        request=DriftRequest,
        group="drift",
        records={"measurement": sets},
        marks={"measurements": "drift-set"},
        without=MODEL_FIELD,
    )
    return form.fields(advanced=False) if sets else Markup()


async def _result(context: PageContext, id: str) -> str:
    """One check: its verdict, what may have moved, the residuals, and the next step."""
    record = await context.item(DRIFT_CHECK, id)
    (used,) = record.refs("model")
    model: ModelRecord = await context.item(MODEL, used.id, used.version)
    (data,) = record.refs("data")
    detail = record.detail
    poses = [(each, math.hypot(*each["residual_mm"])) for each in detail["poses"]]
    lines = [pose["line"] for pose in detail["poses"]]
    return context.render(
        "drift_result.html",
        record=record,
        detail=detail,
        model=model,
        verdict=record.verdict.replace(" ", "_"),
        tone=TONES[record.verdict],
        jobs=await context.jobs("transfer", model=model.id),
        poses=poses,
        worst=max(poses, key=lambda each: each[1]),
        unseen=", ".join(_cause(context, name, lines) for name in detail["not_seen"]),
        causes=[
            (_cause(context, each["name"], lines), _shifts(decode(_CauseTerms, each)), each)
            for each in detail["causes"][:MOST_CAUSES]
        ],
        update={"model": model.id, "measurements": [data.id]},
        probability=_probability,
    )


def _probability(p: float) -> str:
    return f"< {LEAST_CHANCE:g}" if p < LEAST_CHANCE else f"{p:.2g}"


def _cause(context: PageContext, name: str, lines: Sequence[int]) -> str:
    kind, _, number = name.partition(" ")
    if kind == "reading":
        return context.say("drift.cause_reading", line=lines[int(number) - 1])
    if kind == "joint":
        return context.say("drift.cause_joint", number=number)
    return context.say(f"drift.cause_{kind}")


@dataclass(frozen=True, slots=True)
class _CauseTerms:
    """Shift of each term of a cause, and its standard deviation; units in the names."""

    shift: dict[str, float]
    sd: dict[str, float]


def _shifts(cause: _CauseTerms) -> list[str]:
    """Returns the shift of each term, with a standard deviation."""
    shown = []
    for key, value in cause.shift.items():
        term, _, unit = key.rpartition("_")
        name = "" if term.startswith("theta") else f"{term} "
        mark = "°" if unit == "deg" else f" {unit}"
        shown.append(f"{name}{value:+.4f} ± {cause.sd[key]:.4f}{mark}")
    return shown


BUILDS: Final = {"": _build}
