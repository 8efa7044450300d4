"""What a queue holds is bounded; what it loses is counted, or nothing."""

from __future__ import annotations

import asyncio

import pytest

from robotrue.errors import ConfigurationError
from robotrue.online.queues import LatestQueue, LosslessQueue


def test_latest_drops_the_oldest_and_counts() -> None:
    async def story() -> tuple[list[int], int]:
        queue: LatestQueue[int] = LatestQueue(3)
        for k in range(10):
            queue.put(k)
        queue.close()
        queue.put(99)
        taken = []
        while (item := await queue.take()) is not None:
            taken.append(item)
        return taken, queue.dropped

    assert asyncio.run(story()) == ([7, 8, 9], 8)


def test_latest_wakes_who_waits() -> None:
    async def story() -> int | None:
        queue: LatestQueue[int] = LatestQueue(1)
        waiting = asyncio.create_task(queue.take())
        await asyncio.sleep(0)
        queue.put(5)
        return await asyncio.wait_for(waiting, 5.0)

    assert asyncio.run(story()) == 5


def test_lossless_waits_and_keeps_everything() -> None:
    async def story() -> tuple[list[int], int, int]:
        queue: LosslessQueue[int] = LosslessQueue(2)
        longest = 0

        async def fill() -> None:
            for k in range(50):
                await queue.put(k)
            queue.close()

        filling = asyncio.create_task(fill())
        taken = []
        while (item := await asyncio.wait_for(queue.take(), 5.0)) is not None:
            longest = max(longest, len(queue))
            taken.append(item)
        await filling
        return taken, longest, queue.waits

    taken, longest, waits = asyncio.run(story())
    assert taken == list(range(50))
    assert longest <= 2
    assert waits > 0


def test_closed_and_too_small() -> None:
    async def story() -> None:
        queue: LosslessQueue[int] = LosslessQueue(1)
        await queue.put(1)
        late = asyncio.create_task(queue.put(2))
        await asyncio.sleep(0)
        queue.close()
        with pytest.raises(ConfigurationError, match="closed"):
            await asyncio.wait_for(late, 5.0)
        assert await queue.take() == 1
        assert await queue.take() is None

    asyncio.run(story())
    with pytest.raises(ConfigurationError, match="room for 0"):
        LatestQueue(0)
