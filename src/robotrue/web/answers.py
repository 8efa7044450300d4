"""Answers that were given lately: a version of an item never changes, nor does what it is asked."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Final, TypeAlias

from robotrue.web.workers import P, QueryWorkers

KEPT: Final = 24
"""Answers."""
BYTES: Final = 16 * 1024 * 1024
"""Of all answers together."""
Key: TypeAlias = tuple[Hashable, ...]


class Answers:
    """Asks each question once; two who ask at the same time wait for one answer."""

    def __init__(self, workers: QueryWorkers) -> None:
        self._workers = workers
        self._kept: OrderedDict[Key, bytes] = OrderedDict()
        self._asked: dict[Key, asyncio.Task[bytes]] = {}

    async def once(self, call: Callable[P, bytes], *args: P.args, **kwargs: P.kwargs) -> bytes:
        """Returns the answer; the arguments must name versions, so that it can be kept.

        Raises:
            RobotrueError: What the function raised; it is called again next time.
        """
        key = (call, args, *kwargs.items())
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        if key not in self._asked:
            self._asked[key] = asyncio.create_task(self._workers.ask(call, *args, **kwargs))
            self._asked[key].add_done_callback(lambda _: self._asked.pop(key, None))
        answer = await asyncio.shield(self._asked[key])
        self._kept[key] = answer
        while len(self._kept) > KEPT or sum(map(len, self._kept.values())) > BYTES:
            self._kept.popitem(last=False)
        return answer
