"""The service: sources, estimator, record and sinks as tasks that do not bring each other down.

A source that fails is opened again and its estimates are invalid meanwhile. A sink that fails is
alone with it. A fault in the service itself first brings the correction to zero, then ends it.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Final

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.clocks import ClockFix
from robotrue.online.corrections import Corrections
from robotrue.online.estimates import EstimateBlock
from robotrue.online.link import Health, Sink, StreamSource, health_document
from robotrue.online.queues import LatestQueue, LosslessQueue
from robotrue.online.record_frames import Arrays, Content, Kind
from robotrue.online.record_writer import RecordWriter
from robotrue.online.resume import later_than
from robotrue.online.sensing_chain import STREAMS, SensingChain, Stream

_RETRY: Final = (0.5, 5.0)
"""s before a source that failed is opened again: the first time, and the longest."""
_PATIENCE: Final = 10.0
"""s for a source to give what it has read, once it is closed."""
_ROOM: Final = 0.01
"""s between two looks at whether the record has room, where the sources can wait."""
_APART: Final = 0.03
"""s, usual largest lag of joints after the forces (two slow cycles)."""
_OTHER: Final = 10.0
"""s; farther apart they are of two clocks, or no joints have come."""
_ON_THEIR_WAY: Final = 0.05
"""s in which joints that have come get through a busy computer."""
_MOST_ROWS: Final = 2_000_000
"""Samples after which a checkpoint is due, however fast they came."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkPlan:
    """A sink and how it is served.

    Attributes:
        sink: Receiver of the estimates.
        blocks: Blocks that may wait for it.
        whole: It is to get every estimate where the sources can wait (a file of a replay); else
            the oldest go where it cannot keep up.
        missed: Estimates that it is given first, after the last line that it has (None for
            nothing); what is not later than that line is not given to it again.
    """

    sink: Sink
    blocks: int = 256
    whole: bool = False
    missed: Callable[[str | None], Iterable[EstimateBlock]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """Timing and patience of the service.

    Attributes:
        patient: The sources can wait: they are read in step, and nothing runs ahead of the record.
        health_every: s between two snapshots.
        checkpoint_every: s between two checkpoints in the record.
        seconds: How long; None until the forces end or it is stopped.
        skip_estimates: Estimates that were recorded before and will be made again.
    """

    patient: bool = False
    health_every: float = 1.0
    checkpoint_every: float = 10.0
    seconds: float | None = None
    skip_estimates: int = 0

    def __post_init__(self) -> None:
        """Checks."""
        for name in ("health_every", "checkpoint_every"):
            if not getattr(self, name) > 0.0:
                raise ConfigurationError(f"{name} is {getattr(self, name)} s, expected above 0.")
        if self.seconds is not None and not self.seconds > 0.0:
            raise ConfigurationError(f"{self.seconds:g} s to run, expected more than 0.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """The service at a moment.

    Attributes:
        running: s since it was started.
        rows: Samples taken by stream, those of a record that is gone on with included.
        given: Estimates made.
        invalid: Of these, not valid; since this start.
        latest: The latest estimate, a block of one.
        sources, sinks: Their counters.
        record: Likewise, if there is one.
        clocks: Of the streams.
        faults: Of this service, the latest of each part, in words.
        correction_um: Shift that the robot holds, in the axes of its correction; None without.
        correction_why: Why corrections are at zero, or empty.
    """

    running: float
    rows: Mapping[Stream, int]
    given: int
    invalid: int
    latest: EstimateBlock | None
    sources: Mapping[Stream, Health]
    sinks: Sequence[Health]
    record: Health | None
    clocks: Mapping[Stream, ClockFix]
    faults: Mapping[str, str]
    correction_um: tuple[float, ...] | None
    correction_why: str


async def sense(
    joints: StreamSource[JointBlock],
    force: StreamSource[ForceBlock],
    chain: SensingChain,
    *,
    sinks: Sequence[SinkPlan] = (),
    record: RecordWriter | None = None,
    corrections: Corrections | None = None,
    settings: ServiceSettings | None = None,
    watch: Callable[[Snapshot], None] | None = None,
    stop: asyncio.Event | None = None,
) -> Snapshot:
    """Returns the snapshot when the forces ended, the time was over or it was stopped.

    Args:
        joints: Joints of the robot.
        force: Forces on the tool.
        chain: Blocks to estimates.
        sinks: Receivers of the estimates.
        record: Inputs, estimates, checkpoints and health.
        corrections: Sends minus the error to the robot.
        settings: Times, and the state to continue from.
        watch: Called with every snapshot.
        stop: Ends the service cleanly.

    Raises:
        RobotrueError: A record that can no longer be whole, a source or sink that was not
            configured as it should be.
    """
    service = _Service(
        sources={"joints": joints, "force": force},
        chain=chain,
        sinks=[_Served(plan, settings or ServiceSettings()) for plan in sinks],
        record=record,
        corrections=corrections,
        settings=settings or ServiceSettings(),
        watch=watch,
    )
    return await service.run(stop or asyncio.Event())


class _Served:
    """A sink, its queue and its task."""

    def __init__(self, plan: SinkPlan, settings: ServiceSettings) -> None:
        self.plan, self.fault, self.failed = plan, "", 0
        self.line: str | None = None
        kind = LosslessQueue if plan.whole and settings.patient else LatestQueue
        self.queue: LatestQueue[EstimateBlock] | LosslessQueue[EstimateBlock] = kind(plan.blocks)

    async def put(self, block: EstimateBlock) -> None:
        if isinstance(self.queue, LatestQueue):
            self.queue.put(block)
        else:
            await self.queue.put(block)

    async def serve(self) -> None:
        """Passes the queue to the sink until it is closed; errors of the sink stay in the sink."""
        if self.plan.missed is not None:
            self.line = getattr(self.plan.sink, "resumed_after", None)
            for block in self.plan.missed(self.line):
                await self._write(block)
        while (item := await self.queue.take()) is not None:
            await self._write(item)

    async def _write(self, estimates: EstimateBlock) -> None:
        block = later_than(estimates, self.line)
        if block is None:
            return
        self.line = None  # times rise: all that follows is later, too
        try:
            await self.plan.sink.write(block)
        except Exception as fault:  # whatever it is: the other sinks and the robot go on
            self.fault, self.failed = f"{type(fault).__name__}: {fault}", self.failed + 1

    def health(self) -> Health:
        own = self.plan.sink.health()
        dropped = self.queue.dropped if isinstance(self.queue, LatestQueue) else 0
        return replace(
            own,
            dropped=own.dropped + dropped,
            refused=own.refused + self.failed,
            last_fault=self.fault or own.last_fault,
        )


@dataclass(slots=True, kw_only=True)
class _Service:
    sources: dict[Stream, StreamSource[JointBlock | ForceBlock]]
    chain: SensingChain
    sinks: list[_Served]
    record: RecordWriter | None
    corrections: Corrections | None
    settings: ServiceSettings
    watch: Callable[[Snapshot], None] | None
    faults: dict[str, str] = field(default_factory=dict)
    invalid: int = 0
    latest: EstimateBlock | None = None
    begun: float = 0.0
    skip_estimates: int = 0
    stopping: bool = False
    silent_since: float = float("nan")
    checkpoint_rows: int = 0
    checkpoint_time: float = 0.0

    async def run(self, stop: asyncio.Event) -> Snapshot:
        self.begun = self.checkpoint_time = time.monotonic()
        self.checkpoint_rows = sum(self.chain.rows.values())
        self.skip_estimates = self.settings.skip_estimates
        serving = await self._open_sinks()
        reading = self._readers()
        waiting: list[asyncio.Task[object]] = [
            asyncio.create_task(stop.wait()),
            asyncio.create_task(self._look()),
        ]
        if self.settings.seconds is not None:
            waiting.append(asyncio.create_task(asyncio.sleep(self.settings.seconds)))
        try:
            await self._until_over(reading, [*waiting, *serving])
        except BaseException:
            if self.corrections is not None:
                self.corrections.guard.release()  # first of all: the robot back on its path
            raise
        finally:
            await self._end(reading, waiting, serving)
        return self.snapshot()

    async def _open_sinks(self) -> list[asyncio.Task[None]]:
        try:
            for served in self.sinks:
                await served.plan.sink.open()
        except BaseException:
            await self._close_sinks()
            for source in self.sources.values():
                await source.close()
            raise
        return [asyncio.create_task(s.serve(), name=s.health().name) for s in self.sinks]

    async def _close_sinks(self) -> None:
        for served in self.sinks:
            with contextlib.suppress(Exception):  # its failure was reported
                await served.plan.sink.close()

    def _readers(self) -> list[asyncio.Task[None]]:
        if self.settings.patient:
            return [asyncio.create_task(self._read_in_step(), name="sources")]
        return [asyncio.create_task(self._read(s), name=s) for s in STREAMS]

    async def _until_over(
        self, reading: list[asyncio.Task[None]], waiting: list[asyncio.Task[object]]
    ) -> None:
        """Waits until the forces have ended or a stop is requested; raises a task's error."""
        while True:
            done, _ = await asyncio.wait(
                [t for t in reading if not t.done()] + waiting, return_when=asyncio.FIRST_COMPLETED
            )
            for task in done:
                task.result()
            if reading[-1].done() or any(t in done for t in waiting):
                return

    async def _end(
        self,
        reading: list[asyncio.Task[None]],
        waiting: list[asyncio.Task[object]],
        serving: list[asyncio.Task[None]],
    ) -> None:
        """Zero correction, sources closed, what was read made into estimates, sinks served."""
        self.stopping = True
        if self.corrections is not None:
            self.corrections.guard.release()
        for task in waiting:
            task.cancel()
        for stream, source in self.sources.items():
            try:
                await source.close()
            except Exception as fault:  # the others are closed in any case
                self.faults[stream] = f"{type(fault).__name__}: {fault}"
        await asyncio.wait(reading, timeout=_PATIENCE)
        for task in reading:
            task.cancel()
        await asyncio.gather(*reading, *waiting, return_exceptions=True)
        for served in self.sinks:
            served.queue.close()
        await asyncio.gather(*serving, return_exceptions=True)
        await self._close_sinks()
        with contextlib.suppress(RobotrueError):  # a broken record has reported it
            self._checkpoint()

    async def _read(self, stream: Stream) -> None:
        """Reads a live stream, and opens it again when it fails."""
        wait = _RETRY[0]
        while not self.stopping:
            try:
                async for block in self.sources[stream].blocks():
                    wait = _RETRY[0]
                    if isinstance(block, ForceBlock):
                        await self._let_joints_in(block)
                    await self._take(block)
                break
            except ConfigurationError:
                raise  # trying again would not make it right
            except (RobotrueError, OSError) as fault:
                self.faults[stream] = str(fault)
                if self.corrections is not None:
                    self.corrections.guard.fault(f"{stream}: {fault}")
            await asyncio.sleep(wait)
            wait = min(2.0 * wait, _RETRY[1])
        if not self.stopping:
            await self._give(self.chain.end_stream(stream))

    async def _let_joints_in(self, block: ForceBlock) -> None:
        """Waits a moment for joints that a busy computer has not delivered yet.

        Forces that overtook them would be without joints, and the filters would settle again. A
        silent robot is waited for once.
        """
        until = time.monotonic() + _ON_THEIR_WAY
        while True:
            latest = self.chain.latest_time("joints")
            if not _APART < block.host_time[-1] - latest < _OTHER or latest == self.silent_since:
                return
            if time.monotonic() > until:
                self.silent_since = latest
                return
            await asyncio.sleep(_ROOM / 4.0)

    async def _read_in_step(self) -> None:
        """Reads recorded streams, always the later one, as fast as they are processed."""
        streams: dict[Stream, AsyncIterator[JointBlock | ForceBlock]] = {
            s: aiter(self.sources[s].blocks()) for s in STREAMS
        }
        while "force" in streams and not self.stopping:
            stream = self.chain.behind()
            if stream not in streams:
                stream = "force"
            block = await anext(streams[stream], None)
            if block is None:
                del streams[stream]
                if self.stopping:
                    return  # closed: a stream that continues another time has not ended
                await self._give(self.chain.end_stream(stream))
                continue
            await self._take(block)
            while self.record is not None and self.record.crowded:
                await asyncio.sleep(_ROOM)
            await asyncio.sleep(0)

    async def _take(self, block: JointBlock | ForceBlock) -> None:
        """Records a block, passes it through the chain, and distributes the estimates."""
        if isinstance(block, ForceBlock):
            self._keep(Kind.FORCE, block)
            found = self.chain.force(block)
        else:
            self._keep(Kind.JOINTS, block)
            found = self.chain.joints(block)
        await self._give(found)
        rows = sum(self.chain.rows.values())
        late = time.monotonic() - self.checkpoint_time >= self.settings.checkpoint_every
        if late or rows - self.checkpoint_rows >= _MOST_ROWS:
            self._checkpoint()

    async def _give(self, found: list[EstimateBlock]) -> None:
        new = [block for estimates in found if (block := self._new(estimates)) is not None]
        for block in new:  # all of them before anything waits: a checkpoint counts them as given
            self._keep(Kind.ESTIMATES, block)
        for block in new:
            self.invalid += len(block) - int(block.valid.sum())
            self.latest = block.take(slice(len(block) - 1, None))
            if self.corrections is not None and not self.stopping:
                self.corrections.take(block)
            for served in self.sinks:
                await served.put(block)

    def _new(self, block: EstimateBlock) -> EstimateBlock | None:
        """Returns the rows of a block that were not recorded before."""
        known = min(self.skip_estimates, len(block))
        self.skip_estimates -= known
        if known == len(block):
            return None
        return block.take(slice(known, None)) if known else block

    def _keep(self, kind: Kind, content: Content | Arrays) -> None:
        if self.record is not None:
            self.record.put(kind, content)

    def _checkpoint(self) -> None:
        self.checkpoint_time = time.monotonic()
        self.checkpoint_rows = sum(self.chain.rows.values())
        if self.record is not None and not self.skip_estimates:
            self.record.put(Kind.CHECKPOINT, self.chain.state())

    async def _look(self) -> None:
        """Takes snapshots periodically, for the record and for ``watch``."""
        while True:
            await asyncio.sleep(self.settings.health_every)
            shot = self.snapshot()
            if self.record is not None:
                self.record.put(Kind.HEALTH, snapshot_document(shot))
                for stream, fix in shot.clocks.items():
                    self.record.put(Kind.CLOCK, {"stream": stream, **asdict(fix)})
            if self.watch is not None:
                self.watch(shot)

    def snapshot(self) -> Snapshot:
        guard = None if self.corrections is None else self.corrections.guard.state()
        return Snapshot(
            running=time.monotonic() - self.begun,
            rows=dict(self.chain.rows),
            given=self.chain.given,
            invalid=self.invalid,
            latest=self.latest,
            sources={s: self.sources[s].health() for s in STREAMS},
            sinks=[served.health() for served in self.sinks],
            record=None if self.record is None else self.record.health(),
            clocks={s: self.chain.fix(s) for s in STREAMS},
            faults=dict(self.faults),
            correction_um=None if guard is None else tuple((guard.held.shift * 1e6).tolist()),
            correction_why="" if guard is None else guard.why,
        )


def snapshot_document(shot: Snapshot) -> dict[str, object]:
    """Returns a snapshot's counters as JSON values; an unknown counter is null."""
    healths = [*shot.sources.values(), *shot.sinks, *([shot.record] if shot.record else [])]
    return {
        "host_s": time.monotonic(),
        "rows": dict(shot.rows),
        "estimates": shot.given,
        "invalid": shot.invalid,
        "healths": [health_document(health) for health in healths],
        "faults": dict(shot.faults),
    }
