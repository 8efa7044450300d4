"""Faults that simulated controllers and sensors show on demand, and what they do to packets."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from robotrue.errors import ConfigurationError

_USUAL: Final = 0.5
"""s, default duration of a fault."""
LEAP: Final = 60.0
"""s by which a clock leaps."""


class FaultKind(enum.Enum):
    """Kinds of faults; not every simulator has every kind."""

    GAP = "gap"
    """Packets are lost: the count continues, nothing arrives."""
    SILENCE = "silence"
    """The other side is gone: it neither sends nor answers, and comes back as after a restart."""
    REPEAT = "repeat"
    """Each packet comes twice."""
    REORDER = "reorder"
    """Packets come in swapped pairs."""
    NAN = "nan"
    """Values that are not a number."""
    SATURATION = "saturation"
    """The sensor is at the end of its range."""
    HANG = "hang"
    """Records continue while the measurement in them is frozen."""
    STATUS = "status"
    """The sensor reports a fault."""
    JUMP = "jump"
    """The sender's clock leaps by a minute and stays there."""
    GARBLE = "garble"
    """Bytes of another protocol."""
    LATE = "late"
    """Packets are held back and come in a bunch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault.

    Attributes:
        kind: What.
        start: s since the simulator began.
        duration: s.
    """

    kind: FaultKind
    start: float
    duration: float = _USUAL

    def __post_init__(self) -> None:
        """Checks."""
        if not (0.0 <= self.start < math.inf and 0.0 < self.duration < math.inf):
            raise ConfigurationError(
                f"fault {self.kind.value} from {self.start:g} s for {self.duration:g} s; both have "
                "to be finite, the second above zero."
            )


def parse_fault(text: str, known: Sequence[FaultKind]) -> Fault:
    """Returns the fault that ``KIND@START_S`` or ``KIND@START_S+DURATION_S`` names.

    Args:
        text: For example ``gap@10+0.5``.
        known: What this simulator can do.

    Raises:
        ConfigurationError: Another form, or a kind that is not known here.
    """
    kind, _, when = text.partition("@")
    start, plus, duration = when.partition("+")
    try:
        return Fault(
            kind=next(k for k in known if k.value == kind),
            start=float(start),
            duration=float(duration) if plus else _USUAL,
        )
    except (StopIteration, ValueError):
        raise ConfigurationError(
            f"fault {text!r}, expected KIND@START_S+DURATION_S with one of "
            f"{', '.join(k.value for k in known)}.",
            hint=f"--fault {known[0].value}@10+0.5",
        ) from None


def showing(faults: Sequence[Fault], kind: FaultKind, since: float) -> bool:
    """Returns whether a kind of fault shows at a time (s since the simulator began)."""
    return any(f.kind is kind and f.start <= since < f.start + f.duration for f in faults)


def clock_leap(faults: Sequence[Fault], since: float) -> float:
    """Returns s by which the sender's clock has leapt at a time (s since the simulator began)."""
    return LEAP * sum(f.kind is FaultKind.JUMP and f.start <= since for f in faults)


FAULTS: Final = tuple(
    kind
    for kind in FaultKind
    if kind not in (FaultKind.SATURATION, FaultKind.HANG, FaultKind.STATUS)
)
"""What simulated controllers can show."""


def cut_in_half(packet: bytes) -> bytes:
    """Returns the first half of a packet."""
    return packet[: len(packet) // 2]


class FaultyWire:
    """Packets held back, swapped, doubled, damaged or lost.

    Args:
        faults: When.
        damage: What a garbled packet becomes.

    Attributes:
        withheld: Packets lost for good.
    """

    def __init__(
        self, faults: Sequence[Fault], damage: Callable[[bytes], bytes] = cut_in_half
    ) -> None:
        self.withheld = 0
        self._faults = tuple(faults)
        self._damage = damage
        self._held: list[bytes] = []

    def transmit(self, packets: Sequence[bytes], since: float) -> list[bytes]:
        """Returns what is sent now, in order, when packets are due.

        Args:
            packets: Those that are due.
            since: s since the simulator began.
        """
        if self._shows(FaultKind.GAP, since) or self._shows(FaultKind.SILENCE, since):
            self.withheld += len(packets)
            return []
        self._held += packets
        if self._shows(FaultKind.LATE, since):
            return []
        sent, self._held = self._held, []
        if self._shows(FaultKind.REORDER, since):
            pairs = len(sent) // 2 * 2
            self._held = sent[pairs:]
            sent = [sent[k ^ 1] for k in range(pairs)]
        if self._shows(FaultKind.REPEAT, since):
            sent = [packet for packet in sent for _ in range(2)]
        if self._shows(FaultKind.GARBLE, since):
            sent = [self._damage(packet) for packet in sent]
        return sent

    def _shows(self, kind: FaultKind, since: float) -> bool:
        return showing(self._faults, kind, since)
