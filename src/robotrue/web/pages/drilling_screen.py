"""Drilling: the monitor of a session, the campaign and what it taught, tests and their reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robotrue.core.document_decoder import decode
from robotrue.drilling.drill_defaults import CAMPAIGN, JOURNAL, MODEL, TEST
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.web.drill_journals import FOLDER, JournalFile, folder_of, journals
from robotrue.web.page_context import PageContext

VIEWS: Final = ("monitor", "model")
TOLERANCE_DEG: Final = 0.1
JOBS: Final = (
    ("drill_fit", "learning_now", "/drilling?view=model&id={id}"),
    ("drill_report", "judging_now", "/drilling?test={id}"),
)


async def _build(context: PageContext) -> str:
    found = await context.ask(journals, context.workspace)
    kept = await _documents(context, JOURNAL)
    view = context.query.get("view", "")
    if view not in VIEWS:
        view = "monitor" if (found or kept) and "id" not in context.query else "model"
    if view == "monitor":
        return await _monitor(context, found, kept)
    return await _model(context)


async def _documents(context: PageContext, kind: str) -> tuple[DocumentRecord, ...]:
    return await context.items(DOCUMENT, ItemQuery(where={"kind": kind}, limit=100))


async def _monitor(
    context: PageContext, found: Sequence[JournalFile], kept: Sequence[DocumentRecord]
) -> str:
    """The session whose journal is chosen, hole by hole."""
    sources = {f"/api/drilling/journals/{each.name}": each.name for each in found}
    sources |= {f"/api/drilling/kept-journals/{each.id}": each.name for each in kept}
    asked = context.query.get("journal", "")
    source = asked if asked in sources else next(iter(sources), "")
    place = await context.ask(folder_of, context.workspace)
    return context.render(
        "drilling_monitor.html",
        views=VIEWS,
        shown="monitor",
        sources=sources,
        source=source,
        ended=next((each for each in kept if source.endswith(each.id)), None),
        tolerance=context.number("tolerance_deg", TOLERANCE_DEG, most=45.0),
        folder=FOLDER,
        command=f"robotrue drill run drill.robotrue --journal {place / 'holes.jsonl'}",
    )


async def _model(context: PageContext) -> str:
    """A foot's model: the reliable correction, and results of tests."""
    models = await _documents(context, MODEL)
    campaigns, tests = await _documents(context, CAMPAIGN), await _documents(context, TEST)
    test = next((each for each in tests if each.id == context.query.get("test")), None)
    wanted = test.refs("model")[0].id if test is not None else context.query.get("id", "")
    record = next((each for each in models if each.id == wanted), models[0] if models else None)
    own: list[DocumentRecord] = []
    others: list[DocumentRecord] = []
    if record is not None:
        own = [each for each in tests if any(to.id == record.id for to in each.refs("model"))]
        if test is not None:
            own = [test, *(each for each in own if each.id != test.id)]
        digest = record.detail["campaign_sha256"]
        others = [each for each in campaigns if each.detail.get("sha256") != digest]
    jobs = [(await context.jobs(kind), f"drilling.{title}", go) for kind, title, go in JOBS]
    return context.render(
        "drilling_model.html",
        views=VIEWS,
        shown="model",
        jobs=jobs,
        record=record,
        models=models,
        campaigns=campaigns,
        others=others,
        tests=own,
        holes=_holes(decode(_TestTilts, dict(own[0].detail))) if own else [],
        tolerance=TOLERANCE_DEG,
    )


@dataclass(frozen=True, slots=True)
class _TestTilts:
    """Tilts of each clamp of a test, a and b, deg."""

    before_deg: list[tuple[float, float]]
    left_deg: list[tuple[float, float]]


def _holes(test: _TestTilts) -> list[dict[str, object]]:
    """The tilts of each hole of a test, before and after, as the monitor shows them."""
    pairs = zip(test.before_deg, test.left_deg, strict=True)
    return [{"before": before, "left": left} for before, left in pairs]


BUILDS: Final = {"": _build}
