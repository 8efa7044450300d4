"""The replay twin of every source: a recorded file with the same interface, fast or in time."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Generic, TypeVar

import numpy as np

from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Block, Flag, ForceBlock, JointBlock
from robotrue.online.link import FORCE_FRAMES, Health, Role, StreamProtocol, StreamSettings
from robotrue.online.net_address import AddressOptions
from robotrue.online.replay_blocks import Repeats, force_blocks, joint_blocks

_TICK: Final = 5e-3
"""s between two blocks in real time."""

B = TypeVar("B", JointBlock, ForceBlock)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings:
    """Record to play and how to play it.

    Attributes:
        name: What messages and health call it.
        path: CSV or, for forces, TDMS.
        speed: Of the record's own time; None plays as fast as it is taken.
        start: Samples that are left out: those a record of the service holds already.
        repeats: How often it is played.
        frame: Frame of recorded forces.
        rows: Samples in a block, at most.
    """

    name: str
    path: str | Path
    speed: float | None = None
    start: int = 0
    repeats: Repeats = field(default_factory=Repeats)
    frame: str = "sensor"
    rows: int = 1024

    def __post_init__(self) -> None:
        """Checks."""
        slow = self.speed is not None and not 1e-3 <= self.speed <= 1e3
        if slow or self.start < 0 or self.rows < 1:
            raise ConfigurationError(
                f"speed {self.speed}, from row {self.start}, blocks of {self.rows}; expected a "
                "speed from 0.001 to 1000, a row from 0 and a block of one or more.",
                source=self.name,
            )


class _Replay(Generic[B]):
    """A file as a source; its samples keep the times they were recorded with."""

    def __init__(self, settings: ReplaySettings) -> None:
        """Opens nothing yet."""
        self._settings = settings
        self._closed = False
        self._health = Health(name=settings.name, connected=False)

    def health(self) -> Health:
        """Returns the present counters; those of losses are of the record."""
        return replace(self._health)

    async def close(self) -> None:
        """Ends an open :meth:`blocks` with its next block."""
        self._closed = True
        self._health.connected = False

    async def blocks(self) -> AsyncIterator[B]:
        """Gives the record once, or as often as it is to be repeated.

        Raises:
            RobotrueError: As the reader of the file, after the samples before the fault.
        """
        settings = self._settings
        self._health.connected = not self._closed
        pace = None if settings.speed is None else _Pace(settings.speed)
        left_out = settings.start
        for block in self._read():
            at = min(left_out, len(block))
            left_out -= at
            if at == len(block):
                await asyncio.sleep(0)
            while at < len(block):
                count = min(settings.rows, len(block) - at)
                if pace is None:
                    await asyncio.sleep(0)
                else:
                    count = min(count, await pace.due(block, at))
                if self._closed:
                    return
                if count:
                    part = block.take(slice(at, at + count))
                    self._count(part)
                    yield part
                at += count
        self._health.connected = False

    def _read(self) -> Iterator[B]:
        raise NotImplementedError

    def _count(self, block: B) -> None:
        self._health.received += len(block)
        self._health.late += int(((block.flags & int(Flag.LATE)) != 0).sum())
        self._health.lost += int(((block.flags & int(Flag.GAP)) != 0).sum())


class ReplayJoints(_Replay[JointBlock]):
    """A recorded robot; ``lost`` of its health counts gaps, not the packets in them."""

    def _read(self) -> Iterator[JointBlock]:
        return joint_blocks(self._settings.path, self._settings.repeats)


class ReplayForce(_Replay[ForceBlock]):
    """A recorded force sensor; ``lost`` of its health counts gaps, not the packets in them."""

    def _read(self) -> Iterator[ForceBlock]:
        settings = self._settings
        return force_blocks(settings.path, settings.repeats, frame=settings.frame)


class _Pace:
    """Selects the samples that are due when a record is played in real time."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._origin = math.nan
        self._begun = 0.0

    async def due(self, block: Block, at: int) -> int:
        """Returns the number of samples from ``at`` on that have come; 0 after a timeout."""
        times = block.host_time[at:]
        if math.isnan(self._origin) and not np.isnan(times).all():
            self._origin = float(times[~np.isnan(times)][0])
            self._begun = time.monotonic()
        await asyncio.sleep(_TICK)
        now = self._origin + (time.monotonic() - self._begun) * self._speed
        later = times > now  # a sample without a time comes with those before it
        return int(np.argmax(later)) if later.any() else len(times)


OPTIONS: Final = {
    "speed": "times as fast as recorded; without it as fast as it goes",
    "from": "ROW, the first that is played",
    "repeat": "how often, or forever",
    "period": "s from one repetition to the next",
    "frame": "sensor, tool or base, axes of recorded forces",
}


def read_replay_address(
    address: str, role: Role, settings: StreamSettings
) -> ReplayJoints | ReplayForce:
    """Returns the joints or the forces of a record.

    Raises:
        ConfigurationError: No such file, or an invalid option or value.
    """
    path, options = AddressOptions.of_path(address, OPTIONS)
    if not Path(path).is_file():
        raise ConfigurationError(
            f"there is no file {path!r}.", source=address, hint="replay://PATH/TO/record.csv"
        )
    forever = options.text("repeat") == "forever"
    times = None if forever else options.whole("repeat", "", default=1)
    made = ReplaySettings(
        name=f"replay://{path}",
        path=path,
        speed=options.number("speed", "") if options.has("speed") else None,
        start=options.whole("from", "", default=0) + settings.start_row,
        repeats=Repeats(
            times=times, period=options.number("period", "s") if options.has("period") else None
        ),
        frame=options.word("frame", FORCE_FRAMES) or "sensor",
    )
    return ReplayJoints(made) if role == "robot" else ReplayForce(made)


PROTOCOL: Final = StreamProtocol(
    example="replay://record.csv", options=OPTIONS, read=read_replay_address
)
