"""The contracts of the service: sources yield blocks, sinks take estimates, each counts its faults.

A source connects, reconnects and answers by itself; the service does not handle packets. One leaf
file per protocol has a ``PROTOCOL``. A slow or lost sink does not affect the others.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Final, Literal, Protocol, TypeVar, runtime_checkable

from robotrue.online.blocks import Block, ForceBlock, JointBlock
from robotrue.online.estimates import EstimateBlock
from robotrue.online.guard import CorrectionGuard
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import CROWDED, Address

Role = Literal["robot", "force"]
"""Whether joints or forces are read from an address: RTDE, EGM and records have both."""
FORCE_FRAMES: Final = ("sensor", "tool", "base")
"""Axes in which a source states forces; the value of its ``frame=``."""
CORRECTION_MODES: Final = tuple(mode.value for mode in CorrectionMode)
"""Values of ``mode=``."""
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
        """Closes the connection; the robot is left without correction."""

    def health(self) -> Health:
        """Returns the present counters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkState:
    """State of a link to its controller; a successor continues from it.

    Attributes:
        watch: The count of its packets.
        peer: Host and port of the controller; None before it came.
        refused: Packets that could not be read.
        reconnects: Times it came back.
        turnaround: Bins of :class:`~robotrue.online.robot_link.Turnaround`.
        slowest: s, the longest of them.
    """

    watch: SequenceState
    peer: Address | None = None
    refused: int = 0
    reconnects: int = 0
    turnaround: Mapping[str, int] = field(default_factory=dict)
    slowest: float = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotLinkSettings:
    """Properties of a controller that no packet states.

    Attributes:
        name: Name in messages and health counters.
        mode: How the controller takes a correction; needed where corrections are sent.
        host: Own address; ``0.0.0.0`` for all.
        port: Own port; 0 takes a free one, None the default.
        waiting: Samples that may wait for their reader before health reports a fault.
        peer: Address and port of the controller, 0 for any port: all other senders are ignored.
    """

    name: str
    mode: CorrectionMode | None = None
    host: str = "0.0.0.0"  # noqa: S104 (the controller is another computer)
    port: int | None = None
    waiting: int = CROWDED
    peer: Address | None = None
    sends_force: ClassVar[bool] = False

    def open_link(
        self, corrector: CorrectionGuard | None, before: LinkState | None = None
    ) -> StreamSource[JointBlock]:
        """Returns the link, which listens and answers from now on.

        Raises:
            ConfigurationError: The address is not available, or corrections cannot be sent safely.
        """
        raise NotImplementedError

    def check_corrections(self) -> CorrectionMode:
        """Returns the mode, if corrections can be sent safely.

        Raises:
            ConfigurationError: They cannot.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamSettings:
    """Settings of a source beyond its address.

    Attributes:
        start_row: Samples a record of the service holds already; only a replay can leave them out.
        peer: Address and port of the only controller that is heard, port 0 for any of its ports.
        trust_restart: RSI: whether a Delay near zero after a pause is a session without correction.
    """

    start_row: int = 0
    peer: Address | None = None
    trust_restart: bool = False


@runtime_checkable
class ForceWithJoints(StreamSource[JointBlock], Protocol):
    """The source of a robot whose messages also hold the measured force."""

    def force(self) -> StreamSource[ForceBlock]:
        """Returns the force as a separate source; always the same object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamProtocol:
    """One protocol, named in ``addresses.PROTOCOLS``.

    Attributes:
        example: An address.
        options: What an address takes after ``?``, with the unit.
        read: Makes the source of an address, or the settings of a link that answers.
        lacks: Why one of the two streams is absent, by its role; without an entry it is present.
        takes_corrections: Whether the controller waits for answers and takes corrections.
        takes_path_axes: Whether it takes them in the axes of its path.
        link_of_force: Name of the robot's link whose messages hold the force that an address means;
            None where forces have a separate source.
        force_rate: Force samples per second where no address states them; None: unknown.
    """

    example: str
    options: Mapping[str, str]
    read: Callable[[str, Role, StreamSettings], StreamSource[Block] | RobotLinkSettings]
    lacks: Mapping[Role, str] = field(default_factory=dict)
    takes_corrections: bool = False
    takes_path_axes: bool = False
    link_of_force: Callable[[str], str] | None = None
    force_rate: float | None = None


class Sink(Protocol):
    """Receiver of estimates. The service calls ``write`` from one task, in order."""

    async def open(self) -> None:
        """Connects, or begins to: a sink that is not available yet must not hold up the service."""

    async def write(self, estimates: EstimateBlock) -> None:
        """Sends one block; a block that cannot be sent is counted, not raised."""

    async def close(self) -> None:
        """Sends the queued blocks and closes the connection."""

    def health(self) -> Health:
        """Returns the present counters."""


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
