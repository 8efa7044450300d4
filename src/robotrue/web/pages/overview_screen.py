"""The project: the stages from the cell to the monitored robot, its progress, and the next step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from robotrue.store import items
from robotrue.store.nouns import CELL, DRIFT_CHECK, MEASUREMENT, MODEL, PROGRAM, Noun
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Workspace
from robotrue.web.page_context import PageContext

CELL_WORDS: Final = frozenset({"cell", "new"})
"""Words in old addresses of a cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """One stage of a project.

    Attributes:
        name: Also the key of its texts.
        noun: Of the items that show that the stage was reached.
        where: Fields those items have.
        first: Address that begins the stage.
    """

    name: str
    noun: Noun[Any]
    where: Mapping[str, str]
    first: str


STAGES: Final[tuple[Stage, ...]] = (
    Stage(name="setup", noun=CELL, where={}, first="/cell?new=1"),
    Stage(name="measure", noun=MEASUREMENT, where={}, first="/measurements"),
    Stage(name="calibrate", noun=MODEL, where={}, first="/calibration"),
    Stage(name="use", noun=PROGRAM, where={"stage": "after"}, first="/programs"),
    Stage(name="monitor", noun=DRIFT_CHECK, where={}, first="/drift"),
)
"""In the order of the work; pages name the stage they belong to."""
REPEATED: Final = STAGES[3]
"""Next stage of a project that has reached all: the next program."""


def count_items(workspace: Workspace) -> dict[str, int]:
    """Returns the number of items of each reached stage, by the stage's name."""
    return {
        stage.name: items.search(workspace, stage.noun, ItemQuery(where=stage.where, limit=1)).total
        for stage in STAGES
    }


async def _build(context: PageContext) -> str:
    if CELL_WORDS & context.query.keys():
        cell = next(screen for screen in context.screens if screen.name == "cell")
        return await cell.builds[""](replace(context, screen=cell))
    following = next((stage for stage in STAGES if not context.stages[stage.name]), REPEATED)
    return context.render("overview.html", stages=STAGES, following=following)


BUILDS: Final = {"": _build}
