"""The cell: the arm where it stands, what was measured, and what the model says of the rest."""

from __future__ import annotations

from html import escape
from typing import Final

from nicegui import ui

from robotrue.store import items
from robotrue.store.nouns import CELL
from robotrue.store.records import Query
from robotrue.web.bench import Bench, Page
from robotrue.web.parts.drop import DropZone
from robotrue.web.parts.frame import html
from robotrue.web.parts.scene import SceneView


async def _build(bench: Bench) -> None:
    if bench.model is not None:
        source = f"/api/scenes/model/{bench.model.id}?version={bench.model.version}"
        _with_scene(bench, source)
        return
    cells = await bench.ask(items.listed, bench.house.workspace, CELL, Query(limit=1))
    if cells.items:
        _with_scene(bench, f"/api/scenes/cell/{cells.items[0].id}")
        return
    _empty(bench)


def _with_scene(bench: Bench, source: str) -> None:
    ui.query("#sheet").classes("full")
    SceneView(bench, source)


def _empty(bench: Bench) -> None:
    say = bench.say
    title, lead = escape(say("cell.title")), escape(say("cell.lead"))
    html(f"<h1>{title}</h1><p class='lead'>{lead}</p>").classes("head")
    DropZone(
        bench,
        title=say("cell.drop"),
        hint=say("cell.drop_hint"),
        accept=".toml",
        then="/api/cells",
        go="/",
    )


PAGE: Final = Page(name="cell", path="/", build=_build)
