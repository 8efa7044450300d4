"""The name and the note of an item, changed where they stand; every change is a version."""

from __future__ import annotations

import json
from html import escape
from typing import Final

from robotrue.store.records import ItemRecord, provenance_of_record
from robotrue.web.bench import Bench
from robotrue.web.language import Wording
from robotrue.web.parts.elements import simulated_mark
from robotrue.web.parts.icons import icon

TEXTS: Final = ("edit", "name", "note", "keep", "before")


def heading(bench: Bench, noun: str, record: ItemRecord, *, level: int = 1) -> str:
    """Returns the name of an item as a heading, a pen to change it, and its note below.

    Args:
        bench: Who looks.
        noun: Of the item.
        record: Its latest version.
        level: Of the heading.
    """
    mark = record_mark(bench.say, record)
    note = f'<p class="lead" style="order:9">{escape(record.note)}</p>' if record.note else ""
    pen = "" if record.deleted else rename_button(bench, noun, record)
    return f"<h{level}>{escape(record.name)}</h{level}>{pen}{mark}{note}"


def rename_button(bench: Bench, noun: str, record: ItemRecord) -> str:
    """Returns a pen that opens the name and the note of an item."""
    say = bench.say
    facts = {
        "noun": noun,
        "id": record.id,
        "version": record.version,
        "name": record.name,
        "note": record.note,
        "text": {key: say(f"naming.{key}") for key in TEXTS} | {"close": say("frame.close")},
    }
    return (
        f'<button class="tool" data-testid="rename" title="{escape(say("naming.edit"))}" '
        f'aria-label="{escape(say("naming.edit"))}" '
        f'data-item="{escape(json.dumps(facts), quote=True)}" '
        f'onclick="bench.rename(JSON.parse(this.dataset.item))">{icon("pen")}</button>'
    )


def record_mark(say: Wording, record: ItemRecord) -> str:
    """Returns the mark of an item whose record says that it rests on simulated data."""
    return simulated_mark(say, provenance_of_record(record).simulated)
