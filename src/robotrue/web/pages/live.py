"""Live: joints, force and the tool's error while it cuts, limits, and what was beyond them."""

from __future__ import annotations

from html import escape
from typing import Final

from nicegui import ui

from robotrue import __version__
from robotrue.web.bench import Bench, Page
from robotrue.web.live_sources import LiveSource, is_allowed, sources
from robotrue.web.parts.elements import delete_button
from robotrue.web.parts.frame import html
from robotrue.web.parts.live import FILES, LiveView
from robotrue.web.settings import SENSE_PORT

COMMAND: Final = f"robotrue sense cell.toml --robot rsi://... --force rdt://... --out ws://127.0.0.1:{SENSE_PORT}"


async def _build(bench: Bench) -> None:
    ui.add_head_html(
        f'<link rel="stylesheet" href="{FILES}/live.css?v={__version__}">'
        f'<link rel="stylesheet" href="/static/live.css?v={__version__}">'
    )
    found = await bench.ask(sources, bench.house.workspace)
    shown = next((each for each in found if each.id == bench.query.get("source")), None)
    if shown is None and found:
        shown = found[-1]
    html(_head(bench, found, shown)).classes("head")
    if shown is not None and not is_allowed(shown.address, bench.house.settings.sense):
        why = f"{escape(bench.say('live.not_named'))} <code>--sense {escape(shown.address)}</code>"
        html(f"<p data-testid='live-not-named'>{why}</p>").classes("card")
    elif shown is not None:
        LiveView(bench, shown)
    _new(bench, first=shown is None)


def _head(bench: Bench, found: tuple[LiveSource, ...], shown: LiveSource | None) -> str:
    say = bench.say
    title = f"<h1>{escape(say('nav.live'))}</h1>"
    if shown is None:
        return f"{title}<p class='lead'>{escape(say('live.lead'))}</p>"
    if len(found) > 1:
        options = "".join(
            f'<option value="{each.id}"{" selected" if each.id == shown.id else ""}>'
            f"{escape(each.name)}</option>"
            for each in found
        )
        chosen = (
            f'<label><select data-testid="live-source" aria-label="{escape(say("live.source"))}" '
            f"onchange=\"location.href='/live?source='+this.value\">{options}</select></label>"
        )
    else:
        chosen = f"<span class='note'>{escape(shown.name)}</span>"
    gone = delete_button(say("frame.delete"), "document", shown.id, "/live")
    return f"{title}{chosen}<div class='acts'>{gone}</div>"


def _new(bench: Bench, *, first: bool) -> None:
    """The form that names a sensing service; where there is none yet, how one is started."""
    say = bench.say
    how = (
        f"<p>{escape(say('live.how'))}</p><code>{escape(COMMAND)}</code>"
        f"<p class='note'>{escape(say('live.how_token'))}</p>"
        if first
        else ""
    )
    html(
        f"<h2>{escape(say('live.first' if first else 'live.another'))}</h2>{how}"
        "<form class='live-add' data-testid='live-add' onsubmit=\"bench.make('/api/live/sources',"
        "Object.fromEntries(new FormData(this)),'/live?source={id}',"
        "this.querySelector('button'));return false\">"
        f"<label class='field'>{escape(say('live.address'))}<input type='text' name='address' "
        f"required maxlength='200' value='ws://127.0.0.1:{SENSE_PORT}' "
        "data-testid='live-address'></label>"
        f"<label class='field'>{escape(say('live.name'))}<input type='text' name='name' "
        "maxlength='200'></label>"
        f"<button class='act' data-testid='live-watch'>{escape(say('live.watch'))}</button></form>"
    ).classes("card live-start")


PAGE: Final = Page(name="live", path="/live", build=_build)
