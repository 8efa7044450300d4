"""Datagrams of named values, taken and answered: a foot, a gauge, a control that can print."""

from __future__ import annotations

import threading
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import Final

from robotrue.errors import RobotrueError
from robotrue.online.link import Health
from robotrue.online.samples import Flag
from robotrue.online.sequence import SequenceState, advance
from robotrue.online.signals import SignalSample, read_signals
from robotrue.online.udp import Address, Inbox, UdpEndpoint

_SILENT: Final = 2.0
"""s without a datagram after which the other side counts as gone."""


class UdpSignals:
    """Listens on an address; answers go to whoever sent the latest sound datagram.

    Args:
        host: Own address.
        port: Own port; 0 takes a free one, ``address`` tells which.
        only: Host that alone is listened to; empty listens to all.

    Raises:
        ConfigurationError: The address cannot be had.
    """

    def __init__(self, host: str, port: int, *, only: str = "") -> None:
        self._only = only
        self._lock = threading.Lock()
        self._inbox: Inbox[SignalSample] = Inbox()
        self._watch = SequenceState(window=10_000)
        self._sender: Address | None = None
        self._latest = float("-inf")
        self._received = self._refused = 0
        self._fault = ""
        self._endpoint = UdpEndpoint(host, port, self._take, closed=self._inbox.close)
        self.address = self._endpoint.address
        self._name = f"udp://{self.address[0]}:{self.address[1]}"
        self._started = False

    async def samples(self) -> AsyncIterator[SignalSample]:
        """Gives samples as they come, until closed."""
        if not self._started:
            self._started = True
            self._endpoint.start()
        while batch := await self._inbox.take():
            for sample in batch:
                yield sample

    def answer(self, data: bytes) -> bool:
        """Sends a datagram to the other side; returns whether there is one and it was sent."""
        with self._lock:
            sender = self._sender
        return sender is not None and self._endpoint.send(data, sender)

    async def close(self) -> None:
        """Ends the stream and lets the port go."""
        await self._endpoint.stop()
        self._inbox.close()

    def health(self, now: float) -> Health:
        """Returns the counters as they stand.

        Args:
            now: s on the monotonic clock.
        """
        with self._lock:
            return Health(
                name=self._name,
                connected=now - self._latest < _SILENT,
                received=self._received,
                lost=self._watch.lost,
                late=self._watch.late,
                refused=self._refused,
                last_fault=self._fault or self._inbox.crowding,
            )

    def _take(self, data: bytes, sender: Address, host_time: float) -> None:
        """In the thread of the endpoint."""
        if self._only and sender[0] != self._only:
            self._refuse(f"a datagram of {sender[0]}, only {self._only} is listened to")
            return
        try:
            sample = read_signals(data, host_time)
        except RobotrueError as cause:
            self._refuse(cause.message)
            return
        with self._lock:
            flags = Flag.NONE
            if sample.sequence >= 0:
                self._watch, flags = advance(self._watch, sample.sequence, host_time)
            self._sender, self._latest = sender, host_time
            self._received += 1
        self._inbox.put(replace(sample, flags=sample.flags | flags))

    def _refuse(self, fault: str) -> None:
        with self._lock:
            self._refused += 1
            self._fault = fault
