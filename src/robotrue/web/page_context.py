"""Context of pages and the HTTP interface: workspace, user's choices, texts."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib import import_module
from typing import Any, Concatenate, Final, ParamSpec, TypeAlias, TypeVar
from urllib.parse import urlencode

from markupsafe import Markup

from robotrue.store import items, jobs
from robotrue.store.nouns import ModelRecord, Noun
from robotrue.store.records import ItemQuery, ItemRecord
from robotrue.store.workspace import Workspace
from robotrue.web.job_process import JobProcess
from robotrue.web.language import Wording
from robotrue.web.live_relay import Relays
from robotrue.web.preferences import CHOICES, Preferences
from robotrue.web.problems import fault_words
from robotrue.web.serve_settings import ServeSettings
from robotrue.web.templating import render
from robotrue.web.workers import Answers, QueryWorkers

P = ParamSpec("P")
R = TypeVar("R")
Item = TypeVar("Item", bound=ItemRecord)
Usual = TypeVar("Usual", float, None)
KEPT_CHOICES: Final = ("model", "registration", "tolerance_mm")
"""Parts of an address that a person states once and that hold for what is opened from there."""
JUST_NOW: Final = timedelta(seconds=15)
"""Ago."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerContext:
    """State that all pages and the HTTP interface share while the server runs.

    Attributes:
        settings: Of the start.
        workspace: Open.
        workers: Processes for slow queries.
        answers: Of those processes, cached for a while.
        job_process: The process that runs jobs.
        relays: Of live data.
    """

    settings: ServeSettings
    workspace: Workspace
    workers: QueryWorkers
    answers: Answers
    job_process: JobProcess
    relays: Relays


@dataclass(frozen=True, slots=True, kw_only=True)
class PageContext:
    """One person looking at one page.

    Attributes:
        server: What everybody shares.
        screen: The one that is shown.
        view: How this person wants to see things.
        say: The words of their language.
        query: The query of the address, after ``?``.
        model: The model shown; None if there is none.
        in_use: Id of the model of pages whose address names none; empty: there is none.
        models: To choose from, the newest first.
        screens: All, in the order of the navigation.
        stages: Number of items of each reached stage of the project, by its name.
    """

    server: ServerContext
    screen: Screen
    screens: tuple[Screen, ...]
    view: Preferences
    say: Wording
    query: Mapping[str, str]
    model: ModelRecord | None
    in_use: str
    models: tuple[ModelRecord, ...]
    stages: Mapping[str, int]

    @property
    def workspace(self) -> Workspace:
        """The workspace that is served."""
        return self.server.workspace

    @property
    def folder(self) -> str:
        """Folder of the workspace, as queries take it."""
        return str(self.server.workspace.folder)

    @property
    def kept_choices(self) -> dict[str, str]:
        """Choices in this page's address that also hold on the next page."""
        named = {name: self.query[name] for name in KEPT_CHOICES if self.query.get(name)}
        if self.model is None or named.get("model") != self.model.id:
            named.pop("model", None)
        return named

    def keep_choices(self, address: str) -> str:
        """Returns another address with the choices that this one's page was shown with."""
        named = urlencode(self.kept_choices)
        return f"{address}{'&' if '?' in address else '?'}{named}" if named else address

    def address_with(self, **named: str) -> str:
        """Returns this page's address with other values in it."""
        return f"{self.screen.path}?{urlencode({**self.query, **named})}"

    def number(self, name: str, usual: Usual, *, most: float) -> float | Usual:
        """Returns a number above zero from the address; the usual one where none is stated."""
        try:
            stated = float(self.query[name])
        except (KeyError, ValueError):
            return usual
        return stated if 0.0 < stated <= most else usual

    def offset(self) -> int:
        """Returns from which row on the address wants a long table."""
        stated = self.query.get("offset", "0")
        return int(stated) if stated.isdigit() and len(stated) < 10 else 0

    async def ask(self, question: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Returns the answer of the store, from a thread so that other pages continue."""
        return await asyncio.to_thread(question, *args, **kwargs)

    async def items(self, noun: Noun[Item], query: ItemQuery) -> tuple[Item, ...]:
        """Returns the items of a noun that a query wants."""
        return (await self.ask(items.search, self.workspace, noun, query)).items

    async def item(self, noun: Noun[Item], id: str, version: int | None = None) -> Item:
        """Returns an item by its id.

        Raises:
            ConfigurationError: There is none.
        """
        return await self.ask(items.get, self.workspace, noun, id, version=version)

    async def creation_times(self, records: Sequence[ItemRecord]) -> Mapping[str, datetime]:
        """Returns when the first version of each item was made, by id."""
        ids = [each.id for each in records]
        return await self.ask(items.read_creation_times, self.workspace, ids)

    async def jobs(self, kind: str, **wanted: str) -> list[jobs.Job]:
        """Returns the jobs of a kind to show, those whose parameters are as wanted."""
        found = await self.ask(shown_jobs, self.workspace, kind)
        return [job for job in found if all(job.parameters.get(k) == v for k, v in wanted.items())]

    async def answer(
        self, call: Callable[Concatenate[str, P], bytes], *args: P.args, **kwargs: P.kwargs
    ) -> Any:
        """Returns what a function of the workspace's folder answers, as JSON values.

        Raises:
            RobotrueError: What the function raised.
        """
        return json.loads(await self.server.answers.once(call, self.folder, *args, **kwargs))

    def render(self, template: str, **values: object) -> Markup:
        """Returns a template with the user and their texts, besides its values."""
        own = {"context": self, "say": self.say, "view": self.view, "choices": CHOICES}
        about = {"screens": self.screens, "fault_words": fault_words(self.say)}
        return render(template, **own, **about, **values)


Build: TypeAlias = Callable[[PageContext], Awaitable[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """One screen.

    Attributes:
        name: Also of its file, and the key of its texts and of its icon.
        path: Address.
        styles: Its additional style sheets, below the folder of static files.
        below: Further address; names in braces are in the query.
        stage: Of the project it belongs to; empty: none, or all.
        operations: Operations with special forms.
    """

    name: str
    path: str
    styles: tuple[str, ...] = ()
    below: str = ""
    stage: str = ""
    operations: tuple[str, ...] = ()

    @property
    def builds(self) -> Mapping[str, Build]:
        """What returns the page, under an empty name, and each part that comes later."""
        found: Mapping[str, Build] = import_module(f"robotrue.web.pages.{self.name}_screen").BUILDS
        return found


def shown_jobs(workspace: Workspace, kind: str) -> list[jobs.Job]:
    """Returns the jobs of a kind that are not over, and the newest one if it has failed.

    A job that finished just before the page reloads is among them: its card leads the user who
    queued it to the result, and is hidden from others.
    """
    found = jobs.search(workspace, kind=kind, limit=20).items
    newest = [each for each in found[:1] if each.state in (jobs.FAILED, jobs.CANCELLED)]
    since = datetime.now(UTC) - JUST_NOW
    just = [each for each in found if each.finished and each.finished > since]
    done = [each for each in just if each.state == jobs.DONE]
    return ([each for each in found if not each.over] or newest) + done
