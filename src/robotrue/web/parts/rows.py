"""A long table, a page of it at a time; a heading sorts by its column."""

from __future__ import annotations

from html import escape
from typing import Any, Final

from robotrue.web.bench import Bench
from robotrue.web.parts.frame import html

LENGTHS: Final = {"position_x": "x mm", "position_y": "y mm", "position_z": "z mm"}


def row_pages(bench: Bench, found: dict[str, Any], address: str, sort: str) -> None:
    """Shows rows of a measurement set.

    Args:
        bench: Who looks.
        found: ``columns``, ``rows``, ``total``, ``offset``.
        address: Of this page, to which ``&sort=`` and ``&offset=`` are added.
        sort: How it is sorted now.
    """
    say = bench.say
    head = "".join(_heading(bench, name, address, sort) for name in found["columns"])
    body = "".join(
        "<tr>" + "".join(f"<td>{_number(k, value)}</td>" for k, value in enumerate(row)) + "</tr>"
        for row in found["rows"]
    )
    first, last = found["offset"] + 1, found["offset"] + len(found["rows"])
    step = max(len(found["rows"]), 1)
    steps = ""
    if first > 1:
        steps += _step(f"{address}&sort={sort}&offset={max(0, first - 1 - 100)}", "‹", "earlier")
    if last < found["total"]:
        steps += _step(f"{address}&sort={sort}&offset={first - 1 + step}", "›", "later")
    html(
        f"<div class='head'><h2>{escape(say('measurements.rows'))}</h2>"
        f"<span class='note'>{first:,}–{last:,} / {found['total']:,}</span>"
        f"<div class='acts'>{steps}</div></div><div class='scroll'>"
        f"<table class='grid' data-testid='rows'><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    ).classes("card")


def _heading(bench: Bench, name: str, address: str, sort: str) -> str:
    shown = LENGTHS.get(name) or (
        bench.say("measurements.line")
        if name == "source_row"
        else name.replace("joints_", "j") + " °"
    )
    down = sort == name
    mark = " ▲" if down else " ▼" if sort == f"-{name}" else ""
    turned = f"-{name}" if down else name
    link = f'<a href="{address}&sort={turned}" style="color:inherit">{escape(shown)}{mark}</a>'
    return f"<th>{link}</th>"


def _step(address: str, sign: str, mark: str) -> str:
    return f'<a class="act quiet" href="{escape(address)}" data-testid="rows-{mark}">{sign}</a>'


def _number(column: int, value: float) -> str:
    return f"{value:.0f}" if column == 0 else f"{value:.3f}"
