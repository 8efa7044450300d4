"""The cell: the arm where it stands, what was measured, and what the model says of the rest."""

from __future__ import annotations

from html import escape
from typing import Final

from nicegui import ui

from robotrue import __version__
from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import CELL, CellRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench, Page
from robotrue.web.parts.cell_form import CellForm, CellText
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.elements import delete_button, when
from robotrue.web.parts.faults import not_found
from robotrue.web.parts.frame import html
from robotrue.web.parts.naming import heading
from robotrue.web.parts.scene import SceneView


async def _build(bench: Bench) -> None:
    ui.add_head_html(f'<link rel="stylesheet" href="/static/cell.css?v={__version__}">')
    workspace, asked = bench.house.workspace, bench.query.get("cell")
    try:
        if asked is not None and bench.query.get("edit"):
            await _text(bench, asked)
            return
        if asked is not None:
            cell = await bench.ask(items.get, workspace, CELL, asked)
            _with_scene(bench, f"/api/scenes/cell/{cell.id}", cell)
            return
    except ConfigurationError as error:
        html(not_found(bench.say, error))
        return
    cells = (await bench.ask(items.search, workspace, CELL, ItemQuery(limit=50))).items
    if bench.query.get("new") or (not cells and bench.model is None):
        _new(bench)
    elif bench.model is not None:
        source = f"/api/scenes/model/{bench.model.id}?version={bench.model.version}"
        own = {to.id for to in bench.model.refs("cell")}
        _with_scene(bench, source, next((each for each in cells if each.id in own), None))
    else:
        _with_scene(bench, f"/api/scenes/cell/{cells[0].id}", cells[0])


def _with_scene(bench: Bench, source: str, cell: CellRecord | None) -> None:
    ui.query("#sheet").classes("full")
    with ui.element("div").style("position:relative"):
        SceneView(bench, source)
        if cell is not None:
            say = bench.say
            html(
                f"{heading(bench, 'cell', cell, level=2)}<span class='note'>v{cell.version}</span>"
                f"<a href='/?cell={cell.id}&edit=1' data-testid='open-text'>"
                f"{escape(say('cell_form.open_text'))}</a>"
                f"<a href='/?new=1' data-testid='open-new'>{escape(say('cell_form.open_new'))}</a>"
            ).classes("cell-card").props('data-testid="cell-card"')


def _new(bench: Bench) -> None:
    say = bench.say
    title, lead = escape(say("cell.title")), escape(say("cell.lead"))
    html(f"<h1>{title}</h1><p class='lead'>{lead}</p>").classes("head")
    CellForm(bench)
    html(f"<h2>{escape(say('cell_form.or_drop'))}</h2>").style("margin:8px 0")
    DropZone(
        bench,
        title=say("cell.drop"),
        hint=say("cell.drop_hint"),
        accept=".toml",
        then="/api/cells",
        go="/?cell={id}",
    )


async def _text(bench: Bench, id: str) -> None:
    say, workspace = bench.say, bench.house.workspace
    every = await bench.ask(items.versions, workspace, CELL, id)
    latest = every[-1]
    stated = bench.query.get("version", "")
    shown = next((each for each in every if str(each.version) == stated), latest)
    gone = delete_button(say("frame.delete"), "cell", latest.id, "/")
    html(
        f"{heading(bench, 'cell', latest)}<span class='note'>v{shown.version}, "
        f"{when(shown.created)}</span><div class='acts'><a class='act quiet' "
        f"href='/?cell={latest.id}'>{escape(say('cell_form.open_view'))}</a>{gone}</div>"
        f"<p class='lead' style='order:10'>{escape(say('cell_form.text_lead'))}</p>"
    ).classes("head")
    CellText(bench, shown, latest.version)
    links = "".join(
        f"<a class='act quiet' href='/?cell={latest.id}&edit=1&version={each.version}'"
        f"{' aria-current=true' if each.version == shown.version else ''}>v{each.version} "
        f"<span class='note'>{when(each.created)}</span></a>"
        for each in reversed(every)
    )
    html(
        f"<h2>{escape(say('cell_form.versions'))}</h2><div class='versions'>{links}</div>"
    ).classes("card").props('data-testid="cell-versions"')


PAGE: Final = Page(name="cell", path="/", build=_build)
