"""History: changes with their time, deleted items and their restoration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.store import items, jobs, journal
from robotrue.store.nouns import DOCUMENT, NOUNS
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Workspace
from robotrue.web.language import Wording
from robotrue.web.live_sources import BEGUN, OVER, alarms
from robotrue.web.page_context import PageContext

PER_PAGE: Final = 100
GONE: Final = "discarded"
"""Actions after which an item has no page any more."""
ALARMS: Final = 1000
"""Of a source that are looked through for those of a page."""
TONES: Final[Mapping[str, str]] = {
    "added": "good", "done": "good", "changed": "busy", "restored": "busy", "deleted": "caution",
    "failed": "bad", "alarm": "caution", "discarded": "bad",
}  # fmt: skip
PAGES_OF: Final = {
    "measurement": "/measurements?id=", "model": "/calibration?model=", "program": "/programs?id=",
    "drift-check": "/drift?id=", "registration": "/registration?registration=",
    "cell": "/cell?cell=", "live": "/live?source=",
}  # fmt: skip
KEPT: Final = (
    "cell", "measurement", "model", "program", "registration", "drift-check", "document",
)  # fmt: skip
"""Nouns whose deleted items are listed."""


async def _build(context: PageContext) -> str:
    deleted = [
        (noun, each)
        for noun in KEPT
        for each in await context.items(NOUNS[noun], ItemQuery(limit=20, deleted=True))
    ]
    offset, workspace = context.offset(), context.workspace
    page = await context.ask(
        journal.entries, workspace, without=(OVER,), offset=offset, limit=PER_PAGE
    )
    kinds = await context.ask(
        _kinds, workspace, [e.item for e in page.items if e.noun == jobs.NOUN]
    )
    known = await context.ask(_alarms, workspace, {e.item for e in page.items if e.action == BEGUN})
    return context.render(
        "history.html",
        deleted=deleted,
        rows=[(each, *_describe_entry(context, each, kinds, known)) for each in page.items],
        tones=TONES,
        older=offset + PER_PAGE if offset + PER_PAGE < page.total else None,
    )


def _describe_entry(
    context: PageContext,
    entry: journal.Entry,
    kinds: Mapping[str, str],
    known: Mapping[str, tuple[str, Mapping[str, object]]],
) -> tuple[str, str, str]:
    """Name, address and a remark on the item of an entry."""
    if entry.action == BEGUN:
        name, alarm = known.get(str(entry.detail.get("key")), (entry.item[:8], entry.detail))
        return name, PAGES_OF["live"] + entry.item, _alarm(context, alarm)
    kind = kinds.get(entry.item, "")
    usual = kind_name(context.say, kind) if kind else entry.item[:8]
    where = "" if entry.action == GONE else PAGES_OF.get(entry.noun, "")
    if kind and kind in context.server.settings.kinds:
        where = f"/tools/{kind}?job="
    return str(entry.detail.get("name") or usual), where and where + entry.item, ""


def kind_name(say: Wording, kind: str) -> str:
    """Returns the name of a kind of job in the reader's language, else its command."""
    known = say.word("history.kind", kind)
    return known if known != kind else kind.replace("_", " ")


def _alarm(context: PageContext, alarm: Mapping[str, object]) -> str:
    """One alarm in one row: it was written when it began and again when it ended."""
    return context.say(
        "history.alarm_said" if alarm["over"] else "history.alarm_open",
        axis=alarm["axis"],
        value=f"{alarm['value_um']:.0f}",
        limit=f"{alarm['limit_um']:g}",
        seconds=f"{alarm['duration_s']:.1f}",
    )


def _kinds(workspace: Workspace, ids: list[str]) -> dict[str, str]:
    return {each: jobs.status(workspace, each).kind for each in dict.fromkeys(ids)}


def _alarms(workspace: Workspace, sources: set[str]) -> dict[str, tuple[str, dict[str, object]]]:
    """Name of its source, and what is known of it in the end, of each alarm by its key."""
    found: dict[str, tuple[str, dict[str, object]]] = {}
    for id in sources:
        name = items.get(workspace, DOCUMENT, id).name
        found |= {str(a["key"]): (name, a) for a in alarms(workspace, id, limit=ALARMS)}
    return found


BUILDS: Final = {"": _build}
