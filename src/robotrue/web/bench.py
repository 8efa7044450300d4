"""What a page is given: the workspace, the user's choices, and the words to say things with."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import ParamSpec, TypeAlias, TypeVar

from robotrue.store.nouns import ModelRecord
from robotrue.store.workspace import Workspace
from robotrue.web.answers import Answers
from robotrue.web.job_process import JobProcess
from robotrue.web.language import Wording
from robotrue.web.live_relay import Relays
from robotrue.web.preferences import Preferences
from robotrue.web.settings import ServeSettings
from robotrue.web.workers import Workers

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True, slots=True, kw_only=True)
class House:
    """What all pages and the HTTP interface share while the server runs.

    Attributes:
        settings: What was asked for at the start.
        workspace: Open.
        workers: Processes for what takes longer than a blink.
        answers: Of those processes, kept for a while.
        job_process: The process that does jobs.
        relays: Of live data.
    """

    settings: ServeSettings
    workspace: Workspace
    workers: Workers
    answers: Answers
    job_process: JobProcess
    relays: Relays


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """One person looking at one page.

    Attributes:
        house: What everybody shares.
        view: How this person wants to see things.
        say: The words of their language.
        query: What stands after ``?`` in the address.
        model: The model shown; None if there is none.
        chosen: Id of the model chosen for all pages; empty: the newest.
        models: To choose from.
    """

    house: House
    view: Preferences
    say: Wording
    query: Mapping[str, str]
    model: ModelRecord | None
    chosen: str
    models: tuple[ModelRecord, ...]

    def kept(self, address: str) -> str:
        """Returns an address of the same page, with the model that was named in this one's."""
        named = self.query.get("model")
        if not named or self.model is None or named != self.model.id:
            return address
        return f"{address}{'&' if '?' in address else '?'}model={self.model.id}"

    async def ask(self, question: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Returns the answer of the store, asked in a thread so that other pages go on."""
        return await asyncio.to_thread(question, *args, **kwargs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """One screen.

    Attributes:
        name: Also the key of its texts and of its icon.
        path: Address.
        build: Fills the page.
    """

    name: str
    path: str
    build: Build


Build: TypeAlias = Callable[[Bench], Awaitable[None]]
