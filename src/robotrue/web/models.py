"""Which model the pages show."""

from __future__ import annotations

import asyncio

from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.nouns import MODEL
from robotrue.store.records import ModelRecord, Query
from robotrue.store.workspace import Workspace


async def shown_model(workspace: Workspace, asked: str | None) -> ModelRecord | None:
    """Returns the model asked for by id, else the newest, or None where there is none."""
    return await asyncio.to_thread(_found, workspace, asked)


def _found(workspace: Workspace, asked: str | None) -> ModelRecord | None:
    if asked:
        try:
            return items.get(workspace, MODEL, asked)
        except ConfigurationError:  # an old link: show the newest, its name stands on the page
            pass
    newest = items.listed(workspace, MODEL, Query(limit=1)).items
    return newest[0] if newest else None
