"""What links to robot controllers have in common: one peer, its silences, counters, the way out.

The controller comes to us; the first that sends what can be read is the one that is answered, until
it falls silent. Everybody else is refused and counted.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Final

from robotrue.errors import FormatError
from robotrue.online.blocks import JointBlock, joint_block
from robotrue.online.link import Corrector, Health
from robotrue.online.samples import Flag, JointSample
from robotrue.online.sequence import SequenceState
from robotrue.online.turnaround import Turnaround
from robotrue.online.udp import Address, Inbox, UdpEndpoint

_SILENCE: Final = 25
"""Cycles without a packet after which the controller is taken as gone."""
_RELEASE: Final = 10.0
"""s, at most, that closing waits for a correction to go to zero."""
_TOLD: Final = 4
"""Packets after the last answer with a correction: an answer that was late is told in them."""
_UNSAFE: Final = Flag.NOT_FINITE | Flag.IMPLAUSIBLE | Flag.CLOCK_JUMP | Flag.SENSOR_FAULT


class RobotLink:
    """A controller on UDP as a source of :class:`~robotrue.online.blocks.JointBlock`.

    Args:
        name: What messages and health call it.
        host: Own address.
        port: Own port; 0 takes a free one, ``address`` tells which.
        cycle: s of the controller.
        watch: Before the first packet.
        corrector: Asked for each answer, from the link's own thread; None corrects nothing.
        waiting: Samples that may wait for their reader before the health says so.

    Raises:
        ConfigurationError: The address cannot be had.
    """

    def __init__(
        self,
        name: str,
        host: str,
        port: int,
        *,
        cycle: float,
        watch: SequenceState,
        corrector: Corrector | None,
        waiting: int,
    ) -> None:
        self._name, self._cycle = name, cycle
        self._watch = watch
        self._corrector = corrector
        self._silence = _SILENCE * cycle
        self._peer: Address | None = None
        self._seen = float("-inf")
        self._refused = self._reconnects = 0
        self._fault = ""
        self._inbox: Inbox[JointSample] = Inbox(waiting)
        self.turnaround = Turnaround()
        self._endpoint = UdpEndpoint(host, port, self._take, closed=self._over)
        self.address = self._endpoint.address

    async def blocks(self) -> AsyncIterator[JointBlock]:
        """Gives samples as they come; ends when closed.

        Raises:
            RobotrueError: A correction that this controller cannot take.
        """
        while samples := await self._inbox.take():
            yield joint_block(samples)

    async def close(self) -> None:
        """Lets a correction go to zero at its rate, then stops answering."""
        if self._corrector is not None:
            self._corrector.release()
            await self._released(self._corrector)
        await self._endpoint.stop()

    @property
    def preferred(self) -> bool:
        """Whether the system lets the answering thread run before all others."""
        return self._endpoint.preferred

    async def _released(self, corrector: Corrector) -> None:
        """Waits for a robot without correction that has had the time to say otherwise."""
        until = time.monotonic() + _RELEASE
        since = None
        while self._there() and time.monotonic() < until:
            if not corrector.at_rest:
                since = None
            elif since is None:
                since = self._watch.received
            elif self._watch.received >= since + _TOLD:
                return
            await asyncio.sleep(self._cycle)

    def health(self) -> Health:
        """Returns the counters as they stand."""
        watch = self._watch
        return Health(
            name=self._name,
            connected=self._there(),
            received=watch.received,
            lost=watch.lost,
            late=watch.late,
            refused=self._refused,
            reconnects=self._reconnects,
            turnaround_p50=self.turnaround.quantile(0.5),
            turnaround_p99=self.turnaround.quantile(0.99),
            last_fault=self._inbox.crowding or self._fault,
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

    def _take(self, data: bytes, sender: Address, host_time: float) -> None:
        """One datagram, in the endpoint's thread."""
        silent = host_time - self._seen > self._silence
        if self._peer is not None and sender != self._peer and not silent:
            self._refuse(f"a second sender, {sender[0]}:{sender[1]}")
            return
        try:
            self._packet(data, sender, host_time, begins=self._peer is None or silent)
        except FormatError as refused:
            self._refuse(str(refused))

    def _begin(self, sender: Address, count: int) -> None:
        """Takes a sender as the peer, with a packet that could be read; before it is answered."""
        before, self._peer = self._peer, sender
        if before is None:
            return
        self._reconnects += 1
        if self._corrector is not None:
            ahead = count - (self._watch.last or 0)
            if sender == before and 0 < ahead <= self._watch.window * self._watch.step:
                self._corrector.fault("the controller was not heard for a while")
            else:
                self._corrector.restarted()

    def _keep(self, sample: JointSample) -> None:
        """Hands a sample on, and tells the corrector of what makes it unsafe."""
        self._seen = sample.host_time
        if sample.flags & Flag.INVALID:
            self._fault = f"packet {sample.sequence}: {sample.flags.name}"
        if self._corrector is not None and sample.flags & _UNSAFE:
            self._corrector.fault(f"a packet with {(sample.flags & _UNSAFE).name}")
        self._inbox.put(sample)

    def _refuse(self, why: str) -> None:
        self._refused += 1
        self._fault = why

    def _there(self) -> bool:
        return self._peer is not None and time.monotonic() - self._seen <= self._silence

    def _over(self, fault: BaseException | None) -> None:
        """The thread has ended."""
        self._inbox.close(fault)
