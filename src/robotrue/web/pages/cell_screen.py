"""The cell: the arm, the measured errors, and the predictions of the model elsewhere."""

from __future__ import annotations

from typing import Final

from robotrue.store import items
from robotrue.store.nouns import CELL, CellRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext


async def _build(context: PageContext) -> str:
    asked = context.query.get("cell")
    if asked is not None and context.query.get("edit"):
        return await _text(context, asked)
    if asked is not None:
        cell = await context.item(CELL, asked)
        return _scene(context, f"/api/scenes/cell/{cell.id}", cell)
    cells = await context.items(CELL, ItemQuery(limit=50))
    if context.query.get("new") or (not cells and context.model is None):
        return context.render("cell_new.html")
    if context.model is not None:
        source = f"/api/scenes/model/{context.model.id}?version={context.model.version}"
        own = {to.id for to in context.model.refs("cell")}
        return _scene(context, source, next((each for each in cells if each.id in own), None))
    return _scene(context, f"/api/scenes/cell/{cells[0].id}", cells[0])


def _scene(context: PageContext, source: str, cell: CellRecord | None) -> str:
    return context.render("cell_scene.html", source=source, cell=cell)


async def _text(context: PageContext, id: str) -> str:
    versions = await context.ask(items.versions, context.workspace, CELL, id)
    stated = context.query.get("version", "")
    shown = next((each for each in versions if str(each.version) == stated), versions[-1])
    return context.render("cell_text.html", versions=versions, latest=versions[-1], shown=shown)


BUILDS: Final = {"": _build}
