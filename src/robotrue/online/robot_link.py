"""Base of links to robot controllers: one peer, its silences, counters, and the shutdown.

The controller comes to us; the first that sends what can be read is the one that is answered, until
it falls silent. Everybody else is refused and counted.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from typing import Final, Generic, TypeVar

from robotrue.errors import FormatError
from robotrue.online.blocks import Flag, JointBlock
from robotrue.online.guard import CorrectionGuard
from robotrue.online.link import Health, LinkState, RobotLinkSettings
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import Address, Inbox, UdpEndpoint

S = TypeVar("S")

_SILENCE: Final = 25
"""Cycles without a packet after which the controller is taken as gone."""
_RELEASE: Final = 10.0
"""s, at most, that closing waits for a correction to go to zero."""
_TOLD: Final = 4
"""Packets after the last answer with a correction: they report an answer that was late."""
_UNSAFE: Final = Flag.NOT_FINITE | Flag.IMPLAUSIBLE | Flag.CLOCK_JUMP | Flag.SENSOR_FAULT


class RobotLink(Generic[S]):
    """A controller on UDP as a source of :class:`~robotrue.online.blocks.JointBlock`.

    The data stored of a packet (``S``) become a block in the reader, not in the thread that
    answers.

    Args:
        settings: Of this controller.
        corrector: Called for each answer, from the link's thread; None corrects nothing.
        port: Own port; 0 takes a free one, which ``address`` states.
        cycle: s of the controller.
        watch: Before the first packet.
        before: State of the ended link that this one replaces: no answers since.

    Raises:
        ConfigurationError: The address is not available.
    """

    def __init__(
        self,
        settings: RobotLinkSettings,
        corrector: CorrectionGuard | None,
        *,
        port: int,
        cycle: float,
        watch: SequenceState,
        before: LinkState | None,
    ) -> None:
        before = before or LinkState(watch=watch)
        self._corrector, self._cycle, self._silence = corrector, cycle, _SILENCE * cycle
        self._watch, self._peer, self._pinned = before.watch, before.peer, settings.peer
        self._seen = float("-inf")
        self._health = Health(
            name=settings.name,
            connected=False,
            refused=before.refused,
            reconnects=before.reconnects,
        )
        self._inbox: Inbox[S] = Inbox(settings.waiting)
        self.turnaround = Turnaround.of(before.turnaround, before.slowest)
        self._endpoint = UdpEndpoint(settings.host, port, self._take, closed=self._over)
        self.address = self._endpoint.address

    async def blocks(self) -> AsyncIterator[JointBlock]:
        """Gives samples as they come; ends when closed.

        Raises:
            RobotrueError: A correction that this controller cannot take.
        """
        while kept := await self._inbox.take():
            yield self._block(kept)

    async def close(self) -> None:
        """Lets a correction go to zero at its rate, then stops answering."""
        if self._corrector is not None:
            self._corrector.release()
            await self._wait_for_release(self._corrector)
        await self._endpoint.stop()

    @property
    def preferred(self) -> bool:
        """True if the system runs the answering thread before all others."""
        return self._endpoint.preferred

    async def _wait_for_release(self, corrector: CorrectionGuard) -> None:
        """Waits until the robot is without correction and has had time to report otherwise."""
        until = time.monotonic() + _RELEASE
        since = None
        while self._there() and not corrector.frozen and time.monotonic() < until:
            if not corrector.at_rest:
                since = None
            elif since is None:
                since = self._watch.received
            elif self._watch.received >= since + _TOLD:
                return
            await asyncio.sleep(self._cycle)

    def health(self) -> Health:
        """Returns the present counters."""
        watch = self._watch
        return replace(
            self._health,
            connected=self._there(),
            received=watch.received,
            lost=watch.lost,
            late=watch.late,
            turnaround_p50=self.turnaround.quantile(0.5),
            turnaround_p99=self.turnaround.quantile(0.99),
            last_fault=self._inbox.crowding or self._health.last_fault,
        )

    @property
    def seen(self) -> tuple[SequenceState, Address | None]:
        """The count of its packets, and their sender."""
        return self._watch, self._peer

    def state(self) -> LinkState:
        """Returns what another link needs to go on for this one."""
        return LinkState(
            watch=self._watch,
            peer=self._peer,
            refused=self._health.refused,
            reconnects=self._health.reconnects,
            turnaround=self.turnaround.counts(),
            slowest=self.turnaround.largest,
        )

    def _packet(self, data: bytes, sender: Address, host_time: float, *, begins: bool) -> None:
        """Answers and keeps one packet of the peer.

        Args:
            data: As it came.
            sender: Whom to answer.
            host_time: s, when it came.
            begins: Whether it is the first, or the first after a silence.

        Raises:
            FormatError: It cannot be read.
        """
        raise NotImplementedError

    def _block(self, kept: list[S]) -> JointBlock:
        """Returns consecutive stored packets as a block."""
        raise NotImplementedError

    def _take(self, data: bytes, sender: Address, host_time: float) -> None:
        """One datagram, in the endpoint's thread."""
        pinned = self._pinned
        if pinned is not None and (sender[0] != pinned[0] or pinned[1] not in (0, sender[1])):
            self._health.refuse(f"{sender[0]}:{sender[1]} is not the stated controller {pinned[0]}")
            return
        if self._corrector is not None and self._peer is not None and sender[0] != self._peer[0]:
            self._health.refuse(
                f"{sender[0]} is not {self._peer[0]}, the controller that is corrected"
            )
            return
        silent = host_time - self._seen > self._silence
        if self._peer is not None and sender != self._peer and not silent:
            self._health.refuse(f"a second sender, {sender[0]}:{sender[1]}")
            return
        try:
            self._packet(data, sender, host_time, begins=self._peer is None or silent)
        except FormatError as refused:
            self._health.refuse(str(refused))

    def _begin(self, sender: Address) -> bool:
        """Takes a sender as the peer, with a packet that could be read; before it is answered.

        Returns:
            Whether it is the previous controller: no other sender is allowed, or the same port.
        """
        before, self._peer = self._peer, sender
        self._health.reconnects += before is not None
        return self._pinned is not None or sender == before

    def _keep(self, kept: S, sequence: int, host_time: float, flags: Flag) -> None:
        """Stores the samples of a packet and reports unsafe flags to the corrector."""
        self._seen = host_time
        if flags:
            if flags & Flag.INVALID:
                self._health.last_fault = f"packet {sequence}: {flags.name}"
            if self._corrector is not None and flags & _UNSAFE:
                self._corrector.fault(f"a packet with {(flags & _UNSAFE).name}")
        self._inbox.put(kept)

    def _there(self) -> bool:
        return self._peer is not None and time.monotonic() - self._seen <= self._silence

    def _over(self, fault: BaseException | None) -> None:
        """The thread has ended."""
        self._inbox.close(fault)


_LEAST: Final = 1e-6
_PER_DECADE: Final = 50
_DECADES: Final = 7


class Turnaround:
    """Times from a packet to its answer, counted in bins 4.7 % wide from 1 us to 10 s."""

    def __init__(self) -> None:
        self._bins = [0] * (_PER_DECADE * _DECADES)
        self.count = 0
        self.largest: float = math.nan

    @classmethod
    def of(cls, counts: Mapping[str, int], largest: float) -> Turnaround:
        """Returns the histogram of the numbers from :meth:`counts`."""
        made = cls()
        for place, count in counts.items():
            made._bins[int(place)] = count
            made.count += count
        made.largest = largest
        return made

    def counts(self) -> dict[str, int]:
        """Returns the bins that hold something, by their number as text (for JSON)."""
        return {str(place): count for place, count in enumerate(self._bins) if count}

    def add(self, seconds: float) -> None:
        """Counts one answer."""
        place = int(math.log10(max(seconds, _LEAST) / _LEAST) * _PER_DECADE)
        self._bins[min(place, len(self._bins) - 1)] += 1
        self.count += 1
        if not seconds <= self.largest:
            self.largest = seconds

    def quantile(self, share: float) -> float:
        """Returns the upper edge in s of the bin that holds a share of the answers; NaN of none."""
        wanted, seen = share * self.count, 0
        for place, count in enumerate(self._bins):
            seen += count
            if count and seen >= wanted:
                return min(_LEAST * math.pow(10.0, (place + 1) / _PER_DECADE), self.largest)
        return math.nan
