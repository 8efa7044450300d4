"""The contracts of the service: sources give blocks, sinks take estimates, each counts its faults.

One file per protocol implements them. A source connects, reconnects and answers by itself; the
service knows nothing of packets. A sink is slow or gone without anybody else noticing.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass
from typing import Protocol, TypeVar

from robotrue.online.blocks import Block
from robotrue.online.estimates import EstimateBlock
from robotrue.online.robot_correction import Correction

B_co = TypeVar("B_co", bound=Block, covariant=True)


@dataclass(slots=True, kw_only=True)
class Health:
    """Counters of one source or sink since it was opened; who counts gives copies away.

    Attributes:
        name: The address it was opened with.
        connected: Whether the other side is there now.
        received: Packets (source) or blocks (sink) taken.
        lost: Packets that never came.
        late: Packets that came late, or answers of ours the controller counted as late.
        refused: Packets that could not be read, or blocks the other side did not take.
        dropped: Blocks left out because a display could not keep up; zero for every source.
        reconnects: Times the other side came back.
        turnaround_p50: s from a packet to our answer, median; NaN where nothing is answered.
        turnaround_p99: s, likewise.
        last_fault: The latest fault in words, or empty.
    """

    name: str
    connected: bool
    received: int = 0
    lost: int = 0
    late: int = 0
    refused: int = 0
    dropped: int = 0
    reconnects: int = 0
    turnaround_p50: float = float("nan")
    turnaround_p99: float = float("nan")
    last_fault: str = ""

    def refuse(self, why: str) -> None:
        """Counts what was refused."""
        self.refused += 1
        self.last_fault = why


class StreamSource(Protocol[B_co]):
    """A stream of blocks."""

    def blocks(self) -> AsyncIterator[B_co]:
        """Gives blocks as they come; ends only where the stream has an end (a file), or closed."""

    async def close(self) -> None:
        """Lets the other side go; a robot is left with no correction."""

    def health(self) -> Health:
        """Returns the counters as they stand."""


class Corrector(Protocol):
    """Says what a robot is to be sent in this cycle; a link asks it for each of its answers.

    A link also tells it what it sees of the controller, from a thread of its own.
    """

    def next(self, host_time: float) -> Correction | None:
        """Returns the correction to send now: limited, ramped, zero when the watchdog bit.

        None where the controller is not to be answered at all.
        """

    def hold(self) -> Correction | None:
        """Returns the answer to a packet whose cycle is over, which moves nothing; or None."""

    def book(self, *, taken: bool) -> None:
        """Takes note, before the next answer, whether the one before was taken for certain."""

    def add_unreported(self, answers: int) -> None:
        """Counts answers that an ended link gave last and did not record."""

    def age(self, host_time: float) -> float:
        """Returns s since the measurement that the correction rests on; 0 where there is none."""

    def count_late(self, answers: int, host_time: float) -> None:
        """Counts answers that came too late to be taken, or were never made."""

    def fault(self, why: str) -> None:
        """Takes note of what makes corrections unsafe: a packet with NaN, a clock that jumped."""

    def note_restart(self, *, certain: bool = True) -> None:
        """Reports that the controller restarts and holds no correction, or may do so."""

    def release(self) -> None:
        """Goes to zero for good: the link is about to be closed."""

    @property
    def at_rest(self) -> bool:
        """Whether the robot holds no correction (any more)."""

    @property
    def frozen(self) -> bool:
        """Whether the robot is not to be moved, since nobody knows what it holds."""


class Sink(Protocol):
    """Where estimates go. The service calls ``write`` from one task, in order."""

    async def open(self) -> None:
        """Connects, or begins to: a sink that is not there yet must not hold up the service."""

    async def write(self, estimates: EstimateBlock) -> None:
        """Sends one block; what cannot be sent is counted, not raised."""

    async def close(self) -> None:
        """Sends what is left and goes."""

    def health(self) -> Health:
        """Returns the counters as they stand."""


HealthDocument = dict[str, str | bool | int | float | None]


def health_document(health: Health) -> HealthDocument:
    """Returns the counters; a turnaround that is not measured is None."""
    document: HealthDocument = {}
    for name, value in asdict(health).items():
        if name.startswith("turnaround"):
            document[f"{name}_ms"] = _ms(value)
        else:
            document[name] = value
    return document


def _ms(seconds: float) -> float | None:
    return round(seconds * 1e3, 3) if math.isfinite(seconds) else None
