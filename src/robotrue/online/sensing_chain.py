"""Converts received blocks to estimates: aligns clocks, orders streams, runs the estimator.

Without tasks, sockets or a separate clock: the output depends on the input alone, so a record of
the input gives the same output again, and a checkpoint continues bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.errors import ModelMismatchError
from robotrue.online.blocks import Flag, ForceBlock, JointBlock
from robotrue.online.clocks import ClockFix, StreamClock
from robotrue.online.estimates import EstimateBlock
from robotrue.online.record_frames import Kind, frame_bytes, frame_content

if TYPE_CHECKING:  # its kernels take a second to load, and aligning clocks needs none of them
    from robotrue.online.sensing import Sensing

Stream: TypeAlias = Literal["joints", "force"]
STREAMS: Final[tuple[Stream, Stream]] = ("joints", "force")
State: TypeAlias = dict[str, npt.NDArray[Any]]
_JUMP: Final = int(Flag.CLOCK_JUMP)


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamShift:
    """Clock correction added to force times to convert them to joint times.

    Attributes:
        offset: s at ``at``.
        drift: s/s, by which it grows.
        at: s, host time of the force; of no account without drift.
    """

    offset: float = 0.0
    drift: float = 0.0
    at: float = 0.0


class SensingChain:
    """The way of every block through clocks and order into the estimator.

    Attributes:
        rows: Samples taken by stream.
        given: Estimates returned.
    """

    def __init__(
        self, estimator: Sensing, *, shift: StreamShift | None = None, patient: bool = False
    ) -> None:
        """Starts without samples.

        Args:
            estimator: Fed from here on; times of all its blocks are of the host's clock.
            shift: Between the streams' clocks.
            patient: Hold forces back until the joints have passed them: for recorded streams,
                where either may run ahead. Live, a force goes through as it comes.
        """
        self._estimator, self._shift, self._patient = estimator, shift or StreamShift(), patient
        self._clocks = {name: StreamClock() for name in STREAMS}
        self._held: list[ForceBlock] = []
        self._passed = {name: -np.inf for name in STREAMS}
        self.rows = dict.fromkeys(STREAMS, 0)
        self.given = 0

    def joints(self, block: JointBlock) -> list[EstimateBlock]:
        """Takes joints; returns the estimates of forces that waited for them."""
        self.rows["joints"] += len(block)
        time, doubt = self._clocks["joints"].align(block.controller_time, block.host_time)
        self._estimator.joints(
            replace(block, host_time=time, flags=_mark_doubtful(block.flags, doubt))
        )
        if len(time) and np.isfinite(time[-1]):
            self._passed["joints"] = float(time[-1])
        return self._release_held()

    def force(self, block: ForceBlock) -> list[EstimateBlock]:
        """Takes forces; returns the estimates that can be made now, in order."""
        self.rows["force"] += len(block)
        time, doubt = self._clocks["force"].align(block.controller_time, block.host_time)
        shift = self._shift
        if shift.offset or shift.drift:
            time = time + (shift.offset + shift.drift * (time - shift.at))
        if len(time) and np.isfinite(time[-1]):
            self._passed["force"] = float(time[-1])
        self._held.append(replace(block, host_time=time, flags=_mark_doubtful(block.flags, doubt)))
        return self._release_held()

    def end_stream(self, stream: Stream) -> list[EstimateBlock]:
        """Ends a stream; returns the estimates of forces that waited for it."""
        self._passed[stream] = np.inf
        return self._release_held()

    def behind(self) -> Stream:
        """Returns the stream that is to be read next, where both can wait."""
        return "joints" if self._passed["joints"] <= self._passed["force"] else "force"

    def latest_time(self, stream: Stream) -> float:
        """Returns the time of a stream's latest sample, s; minus infinity before the first."""
        return self._passed[stream]

    def fix(self, stream: Stream) -> ClockFix:
        """Returns the offset of a stream's clock from the host's."""
        return self._clocks[stream].fix()

    def state(self) -> State:
        """Returns a checkpoint: all that later estimates depend on."""
        found: State = {
            f"estimator/{name}": values for name, values in self._estimator.state().items()
        }
        for stream in STREAMS:
            clock = self._clocks[stream].state()
            found |= {f"clock/{stream}/{name}": values for name, values in clock.items()}
        for k, block in enumerate(self._held):
            data = frame_bytes(Kind.FORCE, 0, block)
            found[f"held/{k:06d}"] = np.frombuffer(data, np.uint8)
        found["passed"] = np.array([self._passed[s] for s in STREAMS])
        found["count"] = np.array([*(self.rows[s] for s in STREAMS), self.given], dtype=np.int64)
        return found

    def restore(self, state: State) -> None:
        """Continues from :meth:`state`.

        Raises:
            ModelMismatchError: A checkpoint of something else.
        """
        try:
            self._estimator.restore(_part(state, "estimator/"))
            for stream in STREAMS:
                self._clocks[stream].restore(_part(state, f"clock/{stream}/"))
            held = sorted(_part(state, "held/").items())
            self._held = [_force(values.tobytes()) for _, values in held]
            for k, stream in enumerate(STREAMS):
                self._passed[stream] = float(state["passed"][k])
                self.rows[stream] = int(state["count"][k])
            self.given = int(state["count"][len(STREAMS)])
        except KeyError as cause:
            raise ModelMismatchError(
                f"a checkpoint without {cause}.", hint="a record of this robotrue and these models."
            ) from cause

    def _release_held(self) -> list[EstimateBlock]:
        until, found = self._passed["joints"] if self._patient else np.inf, []
        while self._held:
            block = self._held[0]
            ready = len(block)
            if until < np.inf:
                waits = block.host_time >= until  # NaN waits for nothing
                ready = int(np.argmax(waits)) if waits.any() else ready
            if not ready:
                break
            self._held.pop(0)
            if ready < len(block):
                self._held.insert(0, block.take(slice(ready, None)))
                block = block.take(slice(ready))
            found.append(self._estimator.force(block))
            self.given += len(block)
        return found


def _mark_doubtful(flags: IntArray, doubt: BoolArray) -> IntArray:
    return np.asarray(flags | np.where(doubt, _JUMP, 0)) if doubt.any() else flags


def _part(state: State, prefix: str) -> State:
    return {n.removeprefix(prefix): v for n, v in state.items() if n.startswith(prefix)}


def _force(data: bytes) -> ForceBlock:
    content = frame_content(data)
    if not isinstance(content, ForceBlock):
        raise ModelMismatchError("a checkpoint whose waiting forces are none.")
    return content
