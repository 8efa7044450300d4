"""Sources, sinks and an estimator that stand in for the real ones, with faults on demand."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable

import numpy as np

from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import Doubt, EstimateBlock
from robotrue.online.link import Health


class StandIn:
    """An estimator with a memory: a recursion over every force and the joints at its time.

    What it gives depends on the samples and their times alone, not on how they were cut.
    """

    def __init__(self) -> None:
        self.times: list[float] = []
        self.values: list[np.ndarray] = []
        self.memory = np.zeros(3)

    def joints(self, block: JointBlock) -> None:
        self.times.extend(block.host_time.tolist())
        self.values.extend(block.joints)

    def force(self, block: ForceBlock) -> EstimateBlock:
        n = len(block)
        error, joints = np.empty((n, 3)), np.full((n, 6), np.nan)
        doubt = np.zeros(n, dtype=np.int64)
        for i, time in enumerate(block.host_time.tolist()):
            at = int(np.searchsorted(self.times, time, side="right")) - 1
            if at > 64:
                del self.times[: at - 8], self.values[: at - 8]
                at = 8
            if at < 0:
                doubt[i] = int(Doubt.NO_JOINTS)
            elif not block.valid[i]:
                doubt[i] = int(Doubt.BAD_FORCE)
            else:
                joints[i] = self.values[at]
                pull = block.wrench[i, :3] + 30.0 * joints[i, :3]
                self.memory = 0.98 * self.memory + 1e-8 * pull
            error[i] = np.nan if doubt[i] else self.memory
        bad = np.isnan(error)
        return EstimateBlock(
            host_time=block.host_time,
            error=error,
            sd=np.where(bad, np.nan, 1e-6),
            static=np.where(bad, np.nan, error * 0.3),
            wrench=np.where(bad.any(axis=1)[:, None], np.nan, np.nan_to_num(block.wrench)),
            joints=joints,
            sequence=block.sequence,
            doubt=doubt,
        )

    def state(self) -> dict[str, np.ndarray]:
        return {
            "times": np.array(self.times),
            "values": np.array(self.values).reshape(-1, 6),
            "memory": self.memory.copy(),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        self.times = state["times"].tolist()
        self.values = list(state["values"])
        self.memory = state["memory"].copy()


class ListSource:
    """Gives blocks it was told; what stands among them instead of a block is done or raised."""

    def __init__(self, name: str, items: Iterable[object], *, ends: bool = True) -> None:
        self.items, self.ends = iter(items), ends
        self.closed = asyncio.Event()
        self.given, self.opened, self.name = 0, 0, name

    async def blocks(self) -> AsyncIterator[object]:
        self.opened += 1
        for item in self.items:
            if self.closed.is_set():
                return
            if isinstance(item, Exception):
                raise item
            if callable(item):
                await item()
                continue
            self.given += len(item)
            yield item
            await asyncio.sleep(0)
        if not self.ends:
            await self.closed.wait()

    async def close(self) -> None:
        self.closed.set()

    def health(self) -> Health:
        return Health(name=self.name, connected=not self.closed.is_set(), received=self.given)


class ListSink:
    """Keeps what it gets."""

    def __init__(self, slow: Callable[[], object] | None = None, fault: str = "") -> None:
        self.blocks: list[EstimateBlock] = []
        self.slow, self.fault, self.open_now = slow, fault, False

    async def open(self) -> None:
        self.open_now = True

    async def write(self, estimates: EstimateBlock) -> None:
        if self.slow is not None:
            await self.slow()
        if self.fault:
            raise RuntimeError(self.fault)
        self.blocks.append(estimates)

    async def close(self) -> None:
        self.open_now = False

    def health(self) -> Health:
        return Health(name="list", connected=self.open_now, received=len(self.blocks))


def joined(blocks: Iterable[EstimateBlock]) -> dict[str, np.ndarray]:
    """Columns of blocks one after the other."""
    found = list(blocks)
    return {
        name: np.concatenate([getattr(b, name) for b in found])
        for name in EstimateBlock.__dataclass_fields__
    }


def equal(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    """Whether columns are equal bit for bit."""
    return all(one[n].tobytes() == other[n].tobytes() for n in one)


def cut(
    make: Callable[[int, int], object], rows: int, seed: int, *, start: int = 0
) -> list[object]:
    """A stream of known rows in blocks of lengths that chance chose."""
    rng, blocks, done = np.random.default_rng(seed), [], start
    while done < rows:
        n = min(int(rng.integers(1, 400)), rows - done)
        blocks.append(make(done, n))
        done += n
    return blocks
