"""What becomes of a simulator's packets on their way, while a fault shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from robotrue.simulation.online_faults import Fault, FaultKind, showing

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
