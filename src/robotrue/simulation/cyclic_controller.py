"""What simulated controllers with a clock of their own share: cycles, faults, the loop over UDP."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robotrue.simulation.device_defaults import LOCAL_HOST
from robotrue.simulation.joint_motion import ArmMotion, MotionGrid
from robotrue.simulation.online_faults import Fault, FaultKind, FaultyWire, showing

_WHOLE: Final = 0.9
"""Of a cycle; a shorter one gives less time for an answer than a controller would."""
_SHORTEST: Final = 0.5
"""Of a cycle; what a computer that slept makes up for, cycle by cycle."""
_BEHIND: Final = 5
"""Cycles that are made up for so; what lies farther behind is left out where time is kept."""


class Pace:
    """Cycles of an event loop.

    Args:
        cycle: s.
    """

    def __init__(self, cycle: float) -> None:
        self._cycle = cycle
        self._due = asyncio.get_running_loop().time()

    async def wait(self) -> bool:
        """Waits for the end of the cycle that runs; call it right after its packet was sent.

        Returns whether it was shorter than a controller's, to make up for one that was overslept.

        Cycles that lie behind are made up for with shorter ones. A controller never sends two
        packets at once, and a computer that plays one must not, either: the answer to the first
        would be late through no fault of its sender.
        """
        now = asyncio.get_running_loop().time()
        self._due += self._cycle
        room = self._due - now
        await asyncio.sleep(max(room, _SHORTEST * self._cycle))
        return asyncio.get_running_loop().time() - now < _WHOLE * self._cycle

    def skip_overdue(self) -> int:
        """Skips cycles that lie too far behind and returns how many.

        A controller's clock does not go slower because a computer is busy; one that plays it sends
        fewer packets instead, as if they had been lost on their way.
        """
        behind = int((asyncio.get_running_loop().time() - self._due) / self._cycle)
        if behind <= _BEHIND:
            return 0
        self._due += behind * self._cycle
        return behind


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclicSettings:
    """What every such controller needs.

    Attributes:
        motion: Where the arm goes.
        cycles: How many; None goes on to the end of the motion, or until stopped.
        host: Its own address.
        own_port: Its own port; 0 takes a free one.
        faults: What goes wrong, and when.
        keeps_time: A computer too busy for all cycles leaves some out, instead of going slower.
    """

    motion: ArmMotion
    cycles: int | None = None
    host: str = LOCAL_HOST
    own_port: int = 0
    faults: tuple[Fault, ...] = ()
    keeps_time: bool = False


class CyclicController(ABC):
    """A controller cycle by cycle: one packet, what comes meanwhile, the end of the cycle.

    Args:
        settings: Of any such controller.
        cycle: s.

    Attributes:
        cycles: Of its clock so far.
        left_out: Of these, without a packet because this computer was too busy.
        elapsed: s on its clock when the cycle began.
    """

    def __init__(self, settings: CyclicSettings, cycle: float) -> None:
        self.cycles = self.left_out = 0
        self.elapsed = 0.0
        self._wire = FaultyWire(settings.faults)
        self._shared, self._cycle = settings, cycle
        self._grid = MotionGrid(settings.motion, cycle)

    async def run(self, target: tuple[str, int], *, stop: asyncio.Event | None = None) -> None:
        """Sends until there is no more to send, or it is stopped.

        Args:
            target: Address and port its packets go to.
            stop: Set to end it after the cycle that runs.
        """
        settings = self._shared
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(
            lambda: Datagrams(self.take), local_addr=(settings.host, settings.own_port)
        )
        pace = Pace(self._cycle)
        try:
            while not (stop is not None and stop.is_set()):
                packet = self.next_packet()
                if packet is None:
                    break
                for datagram in self._wire.transmit([packet], self.elapsed):
                    transport.sendto(datagram, target)
                self.close_cycle(short=await pace.wait())
                if settings.keeps_time:
                    self.leave_out(pace.skip_overdue())
        finally:
            transport.close()

    def next_packet(self) -> bytes | None:
        """Returns the packet of the cycle that begins; None when there is no more to send."""
        number, last = self.cycles, self._shared.cycles
        elapsed = number * self._cycle
        over = last is not None and number >= last
        if over or self._is_over() or elapsed > self._shared.motion.duration:
            return None
        self.elapsed = elapsed
        silence = FaultKind.SILENCE
        if not self._shows(silence) and showing(
            self._shared.faults, silence, elapsed - self._cycle
        ):
            self._restart()
        self.cycles += 1
        return self._packet(number)

    def leave_out(self, cycles: int) -> None:
        """Lets cycles pass without a packet."""
        self.cycles += cycles
        self.left_out += cycles

    @abstractmethod
    def take(self, data: bytes) -> None:
        """Takes a datagram that came during the cycle."""

    def close_cycle(self, *, short: bool = False) -> None:  # noqa: B027
        """Ends the cycle.

        Args:
            short: Whether the simulator gave it less time than a controller would.
        """

    @abstractmethod
    def _packet(self, number: int) -> bytes:
        """Returns the packet of a cycle, counted from zero."""

    @abstractmethod
    def _restart(self) -> None:
        """Begins anew after a silence."""

    def _is_over(self) -> bool:
        """Returns whether it sends no more."""
        return False

    def _shows(self, kind: FaultKind) -> bool:
        """Returns whether a kind of fault shows in this cycle."""
        return showing(self._shared.faults, kind, self.elapsed)


class Datagrams(asyncio.DatagramProtocol):
    """Hands every datagram on; that nobody listens at the other end yet is no error.

    Args:
        take: Called with each.
    """

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Hands it on."""
        self._take(data)

    def error_received(self, exc: Exception) -> None:
        """Goes on: what was sent stays without an answer."""
