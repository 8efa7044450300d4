"""What was done and when, what was deleted and how it comes back."""

from __future__ import annotations

from html import escape
from typing import Any, Final

from robotrue.store import items, jobs, journal
from robotrue.store.nouns import DOCUMENT, NOUNS
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.store.workspace import Workspace
from robotrue.web.bench import Bench, Page
from robotrue.web.live_sources import BEGUN, OVER, alarms
from robotrue.web.parts.elements import Tone, table, tag, undo_button, when
from robotrue.web.parts.frame import html
from robotrue.web.parts.naming import record_mark

PER_PAGE: Final = 100
GONE: Final = "discarded"
"""What was done by which an item has no page any more."""
ALARMS: Final = 1000
"""Of a source that are looked through for those of a page."""
TONES: Final[dict[str, Tone]] = {
    "added": "good", "done": "good", "changed": "busy", "restored": "busy", "deleted": "caution",
    "failed": "bad", "alarm": "caution", "discarded": "bad",
}  # fmt: skip
PAGES_OF: Final = {
    "measurement": "/measurements?id=", "model": "/calibration?model=", "program": "/programs?id=",
    "drift-check": "/drift?id=", "registration": "/registration?registration=",
    "cell": "/?cell=", "live": "/live?source=",
}  # fmt: skip


async def _build(bench: Bench) -> None:
    say, workspace = bench.say, bench.house.workspace
    html(
        f"<h1>{escape(say('nav.history'))}</h1><p class='lead'>{escape(say('history.lead'))}</p>"
    ).classes("head")
    gone = [
        (noun, each)
        for noun in (
            "cell",
            "measurement",
            "model",
            "program",
            "registration",
            "drift-check",
            "document",
        )
        for each in (
            await bench.ask(items.search, workspace, NOUNS[noun], ItemQuery(limit=20, deleted=True))
        ).items
    ]
    if gone:
        html(f"<h2>{escape(say('history.deleted'))}</h2>{_deleted(bench, gone)}").classes("card")
    stated = bench.query.get("offset", "0")
    offset = int(stated) if stated.isdigit() and len(stated) < 10 else 0
    page = await bench.ask(
        journal.entries, workspace, without=(OVER,), offset=offset, limit=PER_PAGE
    )
    names = await bench.ask(_kinds, workspace, [e.item for e in page.items if e.noun == jobs.NOUN])
    told = await bench.ask(_alarms, workspace, {e.item for e in page.items if e.action == BEGUN})
    rows = [
        (
            when(each.at),
            tag(_word(bench, "action", each.action), TONES.get(each.action, "plain")),
            escape(_word(bench, "noun", each.noun)),
            _alarm(bench, each, told) if each.action == BEGUN else _named(bench, each, names),
            f"v{each.version}" if each.version else "",
        )
        for each in page.items
    ]
    columns = [say(f"history.{c}") for c in ("when", "what", "thing", "name", "version")]
    older = (
        f'<a class="act quiet" href="/history?offset={offset + PER_PAGE}">'
        f"{escape(say('history.older'))}</a>"
        if offset + PER_PAGE < page.total
        else ""
    )
    html(table(columns, rows, words=(0, 1, 2, 3), mark="journal") + older).classes("card")


def _kinds(workspace: Workspace, ids: list[str]) -> dict[str, str]:
    return {each: jobs.status(workspace, each).kind for each in dict.fromkeys(ids)}


def _named(bench: Bench, entry: journal.Entry, kinds: dict[str, str]) -> str:
    kind = kinds.get(entry.item, "")
    name = str(entry.detail.get("name") or (_word(bench, "kind", kind) if kind else entry.item[:8]))
    where = PAGES_OF.get(entry.noun)
    if where is None or entry.action == GONE:
        return escape(name)
    return f'<a href="{where}{entry.item}">{escape(name)}</a>'


def _alarms(workspace: Workspace, sources: set[str]) -> dict[str, tuple[str, dict[str, Any]]]:
    """Name of its source, and what is known of it in the end, of each alarm by its key."""
    found: dict[str, tuple[str, dict[str, Any]]] = {}
    for id in sources:
        name = items.get(workspace, DOCUMENT, id).name
        found |= {str(a["key"]): (name, a) for a in alarms(workspace, id, limit=ALARMS)}
    return found


def _alarm(bench: Bench, entry: journal.Entry, told: dict[str, tuple[str, dict[str, Any]]]) -> str:
    """One alarm in one row: it was written when it began and again when it ended."""
    name, alarm = told.get(str(entry.detail.get("key")), (entry.item[:8], dict(entry.detail)))
    said = bench.say(
        "history.alarm_said" if alarm["over"] else "history.alarm_open",
        axis=alarm["axis"],
        value=f"{alarm['value_um']:.0f}",
        limit=f"{alarm['limit_um']:g}",
        seconds=f"{alarm['duration_s']:.1f}",
    )
    link = f'<a href="{PAGES_OF["live"]}{entry.item}">{escape(name)}</a>'
    return f'{link} <span class="note">{escape(said)}</span>'


def _deleted(bench: Bench, gone: list[tuple[str, ItemRecord]]) -> str:
    say = bench.say
    rows = [
        (
            f"<b>{escape(each.name)}</b>{record_mark(say, each)}",
            escape(_word(bench, "noun", noun)),
            when(each.created),
            undo_button(say("history.undo"), noun, each.id, each.version),
        )
        for noun, each in gone
    ]
    columns = [say(f"history.{c}") for c in ("name", "thing", "when")] + [""]
    return table(columns, rows, words=(0, 1), mark="deleted")


def _word(bench: Bench, group: str, word: str) -> str:
    key = f"history.{group}_{word.replace(' ', '_').replace('-', '_')}"
    return bench.say(key) if bench.say.known(key) else word


PAGE: Final = Page(name="history", path="/history", build=_build)
