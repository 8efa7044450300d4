"""Model shown by the pages: of the address, else the one chosen for all, else the first.

The model in use changes when a user chooses another one, never because another one was made.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Final

from robotrue.errors import ConfigurationError
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT, MODEL, DocumentRecord, ModelRecord
from robotrue.store.records import ItemQuery, Link
from robotrue.store.workspace import Workspace, transaction

KIND: Final = "model of the pages"
OFFERED: Final = 30
"""Models to choose from, the newest; all are on the page Calibration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownModel:
    """The model of a page.

    Attributes:
        model: None if there is none.
        in_use: Id of the one that pages show whose address names none; empty: there is none.
        offered: To choose from.
    """

    model: ModelRecord | None
    in_use: str
    offered: tuple[ModelRecord, ...]


async def shown_model(workspace: Workspace, asked: str | None) -> ShownModel:
    """Returns the model of a page, by the id in its address or without one."""
    return await asyncio.to_thread(_find_models, workspace, asked)


def choose(workspace: Workspace, id: str) -> DocumentRecord:
    """Returns the document that sets the model shown by all pages from now on.

    Raises:
        ConfigurationError: There is no such model, or it is deleted.
    """
    with transaction(workspace) as into:
        model = items.get(into, MODEL, id)
        if model.deleted:
            raise ConfigurationError(f"model {model.name!r} is deleted.", hint="bring it back.")
        before = items.search(into, DOCUMENT, ItemQuery(where={"kind": KIND}, limit=1)).items
        return documents.add(
            into,
            KIND,
            name=model.name,
            about=[Link(role="model", to=model.ref)],
            id=before[0].id if before else None,
        )


def choose_none(workspace: Workspace) -> None:
    """Withdraws the choice: the pages show the model that was made first."""
    with transaction(workspace) as into:
        for each in items.search(into, DOCUMENT, ItemQuery(where={"kind": KIND})).items:
            items.delete(into, DOCUMENT, each.id)


def _find_models(workspace: Workspace, asked: str | None) -> ShownModel:
    listed = items.search(workspace, MODEL, ItemQuery(limit=OFFERED)).items
    # A model that gets another name is not a newer one.
    begun = items.read_creation_times(workspace, [each.id for each in listed])
    offered = tuple(sorted(listed, key=lambda each: begun[each.id], reverse=True))
    stated = items.search(workspace, DOCUMENT, ItemQuery(where={"kind": KIND}, limit=1)).items
    chosen = _living(workspace, stated[0].refs("model")[0].id) if stated else None
    model = in_use = chosen or _first_model(workspace)
    if asked:
        try:
            model = items.get(workspace, MODEL, asked)
        except ConfigurationError:  # an old link: another is shown, with its name on the page
            pass
    return ShownModel(model=model, in_use=in_use.id if in_use else "", offered=offered)


def _first_model(workspace: Workspace) -> ModelRecord | None:
    """The model that was made first; another name does not make a model newer."""
    listed = items.search(workspace, MODEL, ItemQuery(limit=items.MOST)).items
    made = items.read_creation_times(workspace, [each.id for each in listed])
    return min(listed, key=lambda each: made[each.id], default=None)


def _living(workspace: Workspace, id: str) -> ModelRecord | None:
    found = items.get(workspace, MODEL, id)
    return None if found.deleted else found
