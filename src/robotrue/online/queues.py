"""Queues between the tasks of the service: what they hold is bounded, what they lose is counted."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Generic, TypeVar

from robotrue.errors import ConfigurationError

T = TypeVar("T")


class Latest(Generic[T]):
    """A queue for displays: when it is full the oldest goes, and is counted. Putting never waits.

    Attributes:
        dropped: Items that were never taken.
    """

    __slots__ = ("_closed", "_items", "_there", "dropped")

    def __init__(self, most: int) -> None:
        """Starts empty.

        Raises:
            ConfigurationError: Room for less than one.
        """
        self._items: deque[T] = deque(maxlen=_room(most))
        self._there = asyncio.Event()
        self._closed = False
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> None:
        """Adds one; after :meth:`close` it counts as dropped."""
        if self._closed or len(self._items) == self._items.maxlen:
            self.dropped += 1
        if not self._closed:
            self._items.append(item)
            self._there.set()

    def close(self) -> None:
        """Lets the reader take what is left and then end."""
        self._closed = True
        self._there.set()

    async def take(self) -> T | None:
        """Returns the oldest, or None once the queue is closed and empty."""
        while not self._items:
            if self._closed:
                return None
            self._there.clear()
            await self._there.wait()
        return self._items.popleft()


class Lossless(Generic[T]):
    """A queue for files and replays: when it is full, putting waits. Nothing is ever dropped.

    Attributes:
        waits: How often somebody had to wait for room.
    """

    __slots__ = ("_closed", "_items", "_most", "_room", "_there", "waits")

    def __init__(self, most: int) -> None:
        """Starts empty.

        Raises:
            ConfigurationError: Room for less than one.
        """
        self._most = _room(most)
        self._items: deque[T] = deque()
        self._there, self._room = asyncio.Event(), asyncio.Event()
        self._closed = False
        self.waits = 0

    def __len__(self) -> int:
        return len(self._items)

    async def put(self, item: T) -> None:
        """Adds one, as soon as there is room.

        Raises:
            ConfigurationError: The queue is closed: the item would be lost.
        """
        while len(self._items) >= self._most and not self._closed:
            self.waits += 1
            self._room.clear()
            await self._room.wait()
        if self._closed:
            raise ConfigurationError("put into a queue that is closed.")
        self._items.append(item)
        self._there.set()

    def close(self) -> None:
        """Lets the reader take what is left and then end."""
        self._closed = True
        self._there.set()
        self._room.set()

    async def take(self) -> T | None:
        """Returns the oldest, or None once the queue is closed and empty."""
        while not self._items:
            if self._closed:
                return None
            self._there.clear()
            await self._there.wait()
        item = self._items.popleft()
        self._room.set()
        return item


def _room(most: int) -> int:
    if most < 1:
        raise ConfigurationError(f"a queue with room for {most}, expected one or more.")
    return most
