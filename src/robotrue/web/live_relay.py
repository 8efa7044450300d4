"""Relay of live frames: one connection to a sensing service, any number of viewers.

Frames are forwarded unchanged and checked for alarms, also without viewers. Each viewer has its own
queue: one that is slow or asleep loses its oldest frames and does not delay others. A viewer
reports its number of received frames every few frames, so that none waits in buffers and is shown
late.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
from collections.abc import Collection
from datetime import UTC, datetime
from typing import Final, TypedDict

from robotrue.errors import MissingExtraError, RobotrueError
from robotrue.online.queues import LatestQueue
from robotrue.online.ws_door import TOKEN_VARIABLE
from robotrue.store.workspace import Workspace
from robotrue.web.alarms import Alarm, AlarmWatch
from robotrue.web.live_sources import LiveSource, is_allowed, record_alarm, sources

FRAMES: Final = "/frames"
KEPT: Final = 100
"""Frames kept for a viewer that does not take them."""
UNSEEN: Final = 40
"""Frames in transit that a viewer has not acknowledged."""
MOST_VIEWERS: Final = 64
LOOK: Final = 5.0
"""s between two looks which sources there are."""
_LONGEST: Final = 1 << 20
_WAITS: Final = (0.5, 1.0, 2.0, 5.0)
"""s before the next try to reach a service."""


class HealthFrame(TypedDict):
    """Fields that this server changes in a frame on a service's health."""

    dropped: int


class Viewer:
    """A viewer."""

    def __init__(self) -> None:
        self.waiting: LatestQueue[str] = LatestQueue(KEPT)
        self._unseen = 0
        self._room = asyncio.Event()

    async def take(self) -> str | None:
        """Returns the next frame once the viewer has had most of those before; None at the end."""
        while self._unseen >= UNSEEN:
            self._room.clear()
            await self._room.wait()
        self._unseen += 1
        return await self.waiting.take()

    def had(self, frames: int) -> None:
        """Notes that frames were shown."""
        self._unseen = max(0, self._unseen - frames)
        self._room.set()


class Relay:
    """One source: its connection, its viewers, its alarms."""

    def __init__(self, workspace: Workspace, source: LiveSource, token: str = "") -> None:
        """Makes it; :meth:`start` begins.

        Args:
            workspace: Whose journal keeps alarms.
            source: Listened to.
            token: Sent to it; empty: none.
        """
        self.source = source
        self._token = token
        self._workspace = workspace
        self._watch = AlarmWatch(source.limits)
        self._viewers: set[Viewer] = set()
        self._hello = self._health = ""
        self._state = "waiting"
        self._alarms: asyncio.Queue[Alarm] = asyncio.Queue()
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        """Begins to listen and to keep alarms."""
        self._tasks = [asyncio.create_task(self._listen()), asyncio.create_task(self._keep())]

    async def stop(self) -> None:
        """Ends all, with the alarms that are open."""
        listening, keeping = self._tasks
        listening.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await listening
        self._record_alarms(self._watch.end())
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._alarms.join(), 2.0)
        keeping.cancel()
        for viewer in self._viewers:
            viewer.waiting.close()

    def change(self, source: LiveSource) -> None:
        """Continues with other limits or another name."""
        if source.limits != self.source.limits:
            self._record_alarms(self._watch.end())
            self._watch.limits = source.limits
        self.source = source
        self._give(self._limits())

    def join(self) -> Viewer | None:
        """Returns a new viewer, with what it has to know first; None where there are too many."""
        if len(self._viewers) >= MOST_VIEWERS:
            return None
        viewer = Viewer()
        first = [self._hello, self._health, self._limits(), self._source()]
        first += [_alarm_frame(each) for each in self._watch.open]
        for frame in filter(None, first):
            viewer.waiting.put(frame)
        self._viewers.add(viewer)
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Forgets a viewer."""
        self._viewers.discard(viewer)

    async def _listen(self) -> None:
        tries, refusals = 0, _refusals()
        while True:
            with contextlib.suppress(*refusals):  # seen in the state; it is tried again
                await self._follow()
            tries = 0 if self._state == "connected" else tries + 1
            self._at("gone")
            self._record_alarms(self._watch.end())
            await asyncio.sleep(_WAITS[min(tries, len(_WAITS) - 1)])

    async def _follow(self) -> None:
        from websockets.asyncio.client import connect

        class Straight(connect):
            """A service that sends elsewhere is none: the token is not for another."""

            def process_redirect(self, exc: Exception) -> Exception | str:
                return exc

        async with Straight(
            self.source.address + FRAMES,
            additional_headers={"Authorization": f"Bearer {self._token}"} if self._token else None,
            max_size=_LONGEST,
            compression=None,
            open_timeout=5.0,
            close_timeout=1.0,
            proxy=None,
        ) as service:
            async for frame in service:
                self._take(frame)

    def _take(self, frame: str | bytes) -> None:
        """Relays a frame; frames that are not of a sensing service are dropped."""
        if isinstance(frame, bytes):
            return
        try:
            found = json.loads(frame)
            kind = found["type"]
            if kind == "estimates":
                self._record_alarms(self._watch.take(found["bins"], datetime.now(UTC)))
            elif kind == "health":
                self._health = frame
                self._give_health(found)
                return
            elif kind == "hello":
                self._hello = frame
            else:
                return
        except (ValueError, LookupError, TypeError, AttributeError):
            return
        self._give(frame)
        if self._state != "connected":
            self._at("connected")

    def _give(self, frame: str) -> None:
        for viewer in self._viewers:
            viewer.waiting.put(frame)

    def _give_health(self, found: HealthFrame) -> None:
        """Adds the frames that this server dropped per viewer to the service's own count."""
        before = int(found["dropped"])
        for viewer in self._viewers:
            found["dropped"] = before + viewer.waiting.dropped
            viewer.waiting.put(json.dumps(found, separators=(",", ":")))

    def _at(self, state: str) -> None:
        self._state = state
        self._give(self._source())

    def _source(self) -> str:
        return json.dumps({"type": "source", "state": self._state})

    def _limits(self) -> str:
        return json.dumps({"type": "limits", "um": self.source.limits})

    def _record_alarms(self, alarms: list[Alarm]) -> None:
        for each in alarms:
            self._give(_alarm_frame(each))
            self._alarms.put_nowait(each)

    async def _keep(self) -> None:
        """Writes alarms one after the other; waits while the database is unreachable."""
        while True:
            alarm = await self._alarms.get()
            while True:
                try:
                    await asyncio.to_thread(record_alarm, self._workspace, self.source.id, alarm)
                    break
                except RobotrueError:
                    await asyncio.sleep(1.0)
            self._alarms.task_done()


class Relays:
    """The relays of all sources of a workspace."""

    def __init__(self, workspace: Workspace, trusted: Collection[str] = ()) -> None:
        """Makes them; :meth:`watch` is what runs.

        Args:
            workspace: Whose sources they are.
            trusted: Addresses that the operator named: these, and services on this computer,
                are connected to; only these are sent the token of ``ROBOTRUE_WS_TOKEN``.
        """
        self._workspace, self._trusted = workspace, frozenset(trusted)
        self._running: dict[str, Relay] = {}
        self._wake = asyncio.Event()

    def wake(self) -> None:
        """Looks at once: a source was added or changed."""
        self._wake.set()

    def of(self, id: str) -> Relay | None:
        """Returns the relay of a source."""
        return self._running.get(id)

    async def watch(self) -> None:
        """Keeps a relay for every source until cancelled."""
        try:
            while True:
                with contextlib.suppress(RobotrueError):  # a database that is away for a moment
                    await self._settle(await asyncio.to_thread(sources, self._workspace))
                # Not wait_for: before Python 3.12 it drops a cancellation that meets the event.
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(LOOK):
                        await self._wake.wait()
                self._wake.clear()
        finally:
            await self._settle(())

    async def _settle(self, known: tuple[LiveSource, ...]) -> None:
        wanted = [each for each in known if is_allowed(each.address, self._trusted)]
        for id in set(self._running) - {each.id for each in wanted}:
            await self._running.pop(id).stop()
        for each in wanted:
            relay = self._running.get(each.id)
            if relay is None:
                token = os.environ.get(TOKEN_VARIABLE, "") if each.address in self._trusted else ""
                self._running[each.id] = relay = Relay(self._workspace, each, token)
                relay.start()
            elif relay.source.version != each.version:
                relay.change(each)


def _alarm_frame(alarm: Alarm) -> str:
    return json.dumps({"type": "alarm", **alarm.document})


def _refusals() -> tuple[type[Exception], ...]:
    """Returns the errors a connection may end with; the first source loads their library."""
    try:
        from websockets.exceptions import WebSocketException
    except ImportError as cause:
        raise MissingExtraError(
            "live data need websockets.", hint="pip install 'robotrue[online]'"
        ) from cause
    # ValueError: a host that is no name
    return (OSError, TimeoutError, ValueError, WebSocketException)
