"""Bounded queues between the tasks of the service; dropped items are counted."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Generic, TypeVar

from robotrue.errors import ConfigurationError

T = TypeVar("T")


class _Queue(Generic[T]):
    """Base of both queues: one reader, a size and an end."""

    def __init__(self, most: int) -> None:
        """Starts empty.

        Raises:
            ConfigurationError: Room for less than one.
        """
        if most < 1:
            raise ConfigurationError(f"a queue with room for {most}, expected one or more.")
        self._most = most
        self._items: deque[T] = deque()
        self._change = asyncio.Event()
        self._closed = False

    def __len__(self) -> int:
        return len(self._items)

    def close(self) -> None:
        """Lets the reader take the queued items and then end."""
        self._closed = True
        self._change.set()

    async def take(self) -> T | None:
        """Returns the oldest, or None once the queue is closed and empty."""
        while not self._items and not self._closed:
            await self._wait_for_change()
        item = self._items.popleft() if self._items else None
        self._change.set()
        return item

    async def _wait_for_change(self) -> None:
        self._change.clear()
        await self._change.wait()

    def _append(self, item: T) -> None:
        self._items.append(item)
        self._change.set()


class LatestQueue(_Queue[T]):
    """A queue for displays: when it is full the oldest goes, and is counted. Putting never waits.

    Attributes:
        dropped: Items that were never taken.
    """

    dropped = 0

    def put(self, item: T) -> None:
        """Adds one; after :meth:`close` it counts as dropped."""
        if self._closed or len(self._items) == self._most:
            self.dropped += 1
        if not self._closed:
            if len(self._items) == self._most:
                self._items.popleft()
            self._append(item)


class LosslessQueue(_Queue[T]):
    """A queue for files and replays: when it is full, putting waits. Nothing is ever dropped.

    Attributes:
        waits: How often a writer had to wait for room.
    """

    waits = 0

    async def put(self, item: T) -> None:
        """Adds one, as soon as there is room.

        Raises:
            ConfigurationError: The queue is closed: the item would be lost.
        """
        while len(self._items) >= self._most and not self._closed:
            self.waits += 1
            await self._wait_for_change()
        if self._closed:
            raise ConfigurationError("put into a queue that is closed.")
        self._append(item)
