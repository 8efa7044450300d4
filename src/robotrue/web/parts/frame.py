"""What stands around every page: navigation, model and date, and how one wants to see things."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from typing import Final
from urllib.parse import urlencode

from nicegui import ui

from robotrue import __version__
from robotrue.web.bench import Bench, Page
from robotrue.web.language import LANGUAGES
from robotrue.web.parts.elements import when
from robotrue.web.parts.faults import fault_words
from robotrue.web.parts.icons import icon
from robotrue.web.preferences import CHOICES

SHORTCUTS: Final = ("pages", "theme", "help")


@contextmanager
def frame(bench: Bench, page: Page, pages: Sequence[Page]) -> Iterator[None]:
    """Gives the sheet of a page, with everything around it."""
    ui.dark_mode(bench.view.dark)
    say = bench.say
    ui.add_head_html(fault_words(say))
    with ui.element("div").classes("bench"):
        html(_bar(bench, page), tag="header").classes("bar")
        html(_rail(bench, page, pages), tag="nav").classes("rail").props(
            f'aria-label="{escape(say("frame.navigation"))}"'
        )
        with ui.element("main").classes("sheet").props(f'id=sheet data-testid="page-{page.name}"'):
            yield
    html(_shortcuts(bench), tag="div")


def html(content: str, *, tag: str = "div") -> ui.html:
    """Returns an element of our own text; what users wrote in it must have been escaped."""
    return ui.html(content, sanitize=False, tag=tag)


def _bar(bench: Bench, page: Page) -> str:
    say = bench.say
    name = escape(bench.house.workspace.folder.name)
    leave = (
        '<form method="post" action="/logout"><button class="tool" data-testid="leave" '
        f'title="{escape(say("frame.leave"))}">{icon("leave")}</button></form>'
        if bench.house.settings.guarded
        else ""
    )
    return (
        '<a class="brand" href="/"><img src="/static/icon.svg" alt="" width="28" height="28">'
        f'<b>robotrue</b></a><span class="where" data-testid="workspace">{name}</span>'
        f'<span class="gap"></span>{_model_menu(bench, page)}'
        '<button class="tool" data-testid="theme" onclick="bench.prefer(\'theme\','
        "document.documentElement.dataset.theme==='dark'?'light':'dark')\" "
        f'title="{escape(say("frame.theme"))}">{icon("moon")}</button>'
        f"{_view_menu(bench)}"
        '<button class="tool wide-only" data-testid="keys" '
        "onclick=\"document.getElementById('shortcuts').showModal()\" "
        f'title="{escape(say("frame.shortcuts"))}">{icon("keyboard")}</button>{leave}'
    )


def _model_menu(bench: Bench, page: Page) -> str:
    """The model that is shown, and the others: for this page, or chosen for all pages."""
    say, model = bench.say, bench.model
    if model is None:
        none = escape(say("frame.no_model"))
        return f'<span class="chip none" data-testid="model-chip">{none}</span>'
    rest = {name: value for name, value in bench.query.items() if name != "model"}
    others = "".join(
        f'<a href="{escape(page.path)}?{escape(urlencode({**rest, "model": each.id}))}" '
        f'data-testid="model-other"{" aria-current=true" if each.id == model.id else ""}>'
        f"<b>{escape(each.name)}</b><small>{escape(each.method)}, {when(each.created)}</small></a>"
        for each in bench.models
    )
    if bench.chosen == model.id:
        act, word = "bench.chooseModel(null,this)", "frame.model_newest"
    else:
        act, word = f"bench.chooseModel('{model.id}',this)", "frame.model_everywhere"
    return (
        '<details class="menu"><summary class="chip" data-testid="model-chip" '
        f'title="{escape(say("frame.model_choose"))}"><b>{escape(model.name)}</b>'
        f"<span>v{model.version}</span><span>{escape(model.method)}</span>"
        f'<time>{when(model.created)}</time></summary><div class="drop models">'
        f'<small>{escape(say("frame.model_here"))}</small><div class="model-list">{others}</div>'
        f'<button class="act" data-testid="model-choose" onclick="{act}">{escape(say(word))}'
        f'</button><a class="act quiet" href="/calibration?model={model.id}" '
        f'data-testid="model-open">{escape(say("frame.model_open"))}</a></div></details>'
    )


def _view_menu(bench: Bench) -> str:
    say = bench.say
    rows = []
    for name, choices in CHOICES.items():
        options = "".join(
            f'<option value="{c}"{" selected" if getattr(bench.view, name) == c else ""}>'
            f"{escape(LANGUAGES[c] if name == 'language' else say(f'view.{name}_{c}'))}</option>"
            for c in choices
        )
        rows.append(
            f'<label>{escape(say(f"view.{name}"))}<select data-testid="view-{name}" '
            f"onchange=\"bench.prefer('{name}',this.value)\">{options}</select></label>"
        )
    return (
        '<details class="menu"><summary class="tool" data-testid="view-menu" '
        f'title="{escape(say("frame.view"))}">{icon("settings")}</summary>'
        f'<div class="drop">{"".join(rows)}<small>robotrue {__version__}</small></div></details>'
    )


def _rail(bench: Bench, page: Page, pages: Sequence[Page]) -> str:
    links = []
    for number, other in enumerate(pages, start=1):
        here = ' aria-current="page"' if other.name == page.name else ""
        key = f' data-shortcut="{number}"' if number < 10 else ""
        links.append(
            f'<a href="{other.path}" data-testid="nav-{other.name}"{here}{key}>'
            f"{icon(other.name)}<span>{escape(bench.say(f'nav.{other.name}'))}</span></a>"
        )
    return "".join(links)


def _shortcuts(bench: Bench) -> str:
    say = bench.say
    rows = "".join(
        f"<dt><kbd>{escape(say(f'shortcut.{name}_key'))}</kbd></dt>"
        f"<dd>{escape(say(f'shortcut.{name}'))}</dd>"
        for name in SHORTCUTS
    )
    return (
        f'<dialog id="shortcuts" data-testid="shortcuts"><h2>{escape(say("frame.shortcuts"))}</h2>'
        f'<dl>{rows}</dl><form method="dialog"><button class="act">'
        f"{escape(say('frame.close'))}</button></form></dialog>"
    )
