"""The project: the way from the cell to the monitored robot, and the next step on it."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from robotrue.web.page_context import PageContext, Screen
from robotrue.web.pages import cell_screen
from robotrue.web.project_stages import STAGES

CELL_WORDS: Final = frozenset({"cell", "new"})
"""What an address says that was once the address of a cell."""


async def _build(context: PageContext) -> str:
    if CELL_WORDS & context.query.keys():
        return await cell_screen.PAGE.build(replace(context, screen=cell_screen.PAGE))
    open_stages = [stage for stage in STAGES if not context.stages[stage.name]]
    return context.render(
        "overview.html", stages=STAGES, following=open_stages[0] if open_stages else None
    )


PAGE: Final = Screen(name="overview", path="/", build=_build, styles=("/static/overview.css",))
