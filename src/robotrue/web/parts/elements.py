"""Small pieces of HTML that many pages use; whatever users wrote is escaped here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from typing import Literal, TypeAlias

from robotrue.core.provenance import simulation_mark
from robotrue.web.bench import Bench
from robotrue.web.language import Wording

Tone: TypeAlias = Literal["good", "caution", "bad", "plain", "busy"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One number that matters.

    Attributes:
        label: What it is.
        value: As printed.
        unit: Behind it, smaller.
        was: The same before, in words; empty: nothing to compare with.
        tone: How it is coloured.
    """

    label: str
    value: str
    unit: str = ""
    was: str = ""
    tone: Tone = "plain"


def tiles(found: Sequence[Tile]) -> str:
    """Returns a row of tiles."""
    return "".join(
        f'<div class="tile {each.tone}"><div class="label">{escape(each.label)}</div>'
        f'<div class="value">{escape(each.value)}'
        f'<span class="unit">{escape(each.unit)}</span></div>'
        + (f'<div class="was">{escape(each.was)}</div>' if each.was else "")
        + "</div>"
        for each in found
    )


def tag(text: str, tone: Tone = "plain") -> str:
    """Returns a short word in a frame."""
    return f'<span class="tag {tone}">{escape(text)}</span>'


def simulated_mark(say: Wording, simulated: bool) -> str:
    """Returns the word that stands behind whatever rests on simulated data; else nothing."""
    word = simulation_mark(simulated, say("scene.simulated"))
    return f' <span class="simulated">{escape(word)}</span>' if word else ""


def table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    words: Sequence[int] = (0,),
    attributes: Sequence[str] = (),
    mark: str = "table",
) -> str:
    """Returns a table; cells are HTML already, so that they may hold tags and links.

    Args:
        columns: Headings.
        rows: HTML of the cells.
        words: Columns aligned left.
        attributes: Of each row, e.g. ``data-row="3"``; from :func:`link_to`.
        mark: For tests.
    """
    side = {k: ' class="w"' for k in words}
    head = "".join(f"<th{side.get(k, '')}>{escape(c)}</th>" for k, c in enumerate(columns))
    body = "".join(
        f"<tr {attributes[n] if attributes else ''}>"
        + "".join(f"<td{side.get(k, '')}>{cell}</td>" for k, cell in enumerate(row))
        + "</tr>"
        for n, row in enumerate(rows)
    )
    return (
        f'<div class="scroll"><table class="grid" data-testid="{mark}">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def link_to(address: str) -> str:
    """Returns the attributes of a table row that opens a page."""
    return f'data-href="{escape(address)}" tabindex="0"'


def model_field(bench: Bench) -> str:
    """Returns the field by which a form goes on with the model that its page's address names."""
    named = bench.query.get("model", "")
    return f'<input type="hidden" name="model" value="{escape(named)}">' if named else ""


def facts(found: Sequence[tuple[str, str]]) -> str:
    """Returns names and values in two columns."""
    rows = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in found)
    return f'<dl class="facts">{rows}</dl>'


def when(moment: datetime) -> str:
    """Returns a time as people of the cell read it, in the zone of the server."""
    return moment.astimezone().strftime("%Y-%m-%d %H:%M")


def undo_button(label: str, noun: str, id: str, version: int) -> str:
    """Returns a button that takes back the version that is seen, unless somebody has since."""
    return (
        f"<button class='act quiet' data-testid='undo' "
        f"onclick=\"bench.undo('{noun}','{id}',this,{version})\">{escape(label)}</button>"
    )


def delete_button(label: str, noun: str, id: str, go: str) -> str:
    """Returns a button that deletes an item; History brings it back."""
    return (
        f'<button class="act quiet" data-testid="delete" '
        f"onclick=\"bench.remove('{noun}','{id}','{go}',this)\">{escape(label)}</button>"
    )
