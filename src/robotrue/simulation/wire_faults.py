"""What becomes of a simulated controller's datagrams on their way, while a fault shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from robotrue.simulation.online_faults import Fault, FaultKind, showing

FAULTS: Final = tuple(
    kind
    for kind in FaultKind
    if kind not in (FaultKind.SATURATION, FaultKind.HANG, FaultKind.STATUS)
)
"""What simulated controllers on UDP can do."""
LEAP: Final = 60.0
"""s by which a clock leaps."""


class FaultyWire:
    """Datagrams held back, swapped, doubled, damaged or lost.

    Args:
        faults: When.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self._held: list[bytes] = []

    def passed(self, packet: bytes, since: float) -> list[bytes]:
        """Returns what is sent now, in order, when a packet is due.

        Args:
            packet: The one that is due.
            since: s since the controller began.
        """
        if self.shows(FaultKind.GAP, since) or self.shows(FaultKind.SILENCE, since):
            return []
        if self.shows(FaultKind.LATE, since):
            self._held.append(packet)
            return []
        if self.shows(FaultKind.REORDER, since):
            self._held.insert(0, packet)
            if len(self._held) < 2:
                return []
            packets, self._held = self._held, []
            return packets
        packets, self._held = [*self._held, packet], []
        if self.shows(FaultKind.REPEAT, since):
            return [packet for packet in packets for _ in range(2)]
        if self.shows(FaultKind.GARBLE, since):
            return [packet[: len(packet) // 2] for packet in packets]
        return packets

    def shows(self, kind: FaultKind, since: float) -> bool:
        """Returns whether a kind of fault shows."""
        return showing(self._faults, kind, since)

    def leapt(self, since: float) -> float:
        """Returns s by which the controller's clock has leapt so far."""
        return LEAP * sum(f.kind is FaultKind.JUMP and f.start <= since for f in self._faults)

    def over(self, kind: FaultKind, since: float, cycle: float) -> bool:
        """Returns whether a fault of a kind ended within the cycle before."""
        return not self.shows(kind, since) and self.shows(kind, since - cycle)
