"""Named values of a machine by UDP, a datagram of JSON each: readings of a foot, its force, axes.

::

    {"seq": 17, "t_s": 3.41, "d1_mm": 1.204, "d2_mm": 0.991, "d3_mm": 1.377, "force_N": 752.1}

For a control without a supported protocol: every control can print a line. Values are numbers or
short texts; the unit is the last part of the name. ``seq`` counts the datagrams and ``t_s`` is the
sender's clock; both may be left out.
"""

from __future__ import annotations

import json
import math
import threading
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from robotrue.errors import FormatError, RobotrueError
from robotrue.online.blocks import Flag
from robotrue.online.link import Health
from robotrue.online.sequence import SequenceState, advance
from robotrue.online.udp import Address, Inbox, UdpEndpoint

LONGEST: Final = 8192
"""Bytes of a datagram."""
MOST: Final = 64
"""Values in a datagram."""
_TEXT: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalSample:
    """Values of one moment.

    Attributes:
        controller_time: s on the sender's clock; NaN where it sends none.
        host_time: s on the receiving computer's monotonic clock.
        values: Numbers by name, in the units of their names; none that is not finite.
        texts: Texts by name.
        missing: Names whose value was ``null`` or not finite.
        sequence: The sender's number of the datagram; -1 where it sends none.
        flags: Its fault.
    """

    controller_time: float
    host_time: float
    values: Mapping[str, float]
    texts: Mapping[str, str] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    sequence: int = -1
    flags: Flag = Flag.NONE

    @property
    def valid(self) -> bool:
        """True if its values may be used."""
        return not self.flags & Flag.INVALID


def read_signals(data: bytes, host_time: float) -> SignalSample:
    """Returns the values of a datagram.

    Args:
        data: The datagram.
        host_time: s, when it came.

    Raises:
        FormatError: Not one flat JSON object in UTF-8, a name twice, a value that is neither number
            nor text, or more than can be meant.
    """
    if len(data) > LONGEST:
        raise FormatError(f"a datagram of {len(data)} bytes, at most {LONGEST} are read.")
    try:
        # whole numbers through float: int() of a thousand digits takes its time
        document = json.loads(data.decode("utf-8"), object_pairs_hook=_once, parse_int=_read_whole)
    except (ValueError, RecursionError) as cause:
        raise FormatError(
            f"a datagram that is no JSON object: {data[:60]!r}.",
            hint='{"seq": 1, "d1_mm": 0.1, "force_N": 500}',
        ) from cause
    if not isinstance(document, dict) or not 0 < len(document) <= MOST:
        raise FormatError(f"a datagram of JSON, expected one object of 1 to {MOST} values.")
    values: dict[str, float] = {}
    texts: dict[str, str] = {}
    missing: list[str] = []
    for name, value in document.items():
        if isinstance(value, str) and len(value) <= _TEXT:
            texts[name] = value
        elif value is None or (isinstance(value, float) and not math.isfinite(value)):
            missing.append(name)
        elif isinstance(value, float):
            values[name] = value
        else:
            raise FormatError(f"{name}: {str(value)[:40]!r}, expected a number or a short text.")
    return SignalSample(
        controller_time=values.pop("t_s", math.nan),
        host_time=host_time,
        sequence=_sequence(values.pop("seq", -1.0)),
        values=values,
        texts=texts,
        missing=tuple(missing),
        flags=Flag.NOT_FINITE if missing else Flag.NONE,
    )


def write_signals(values: Mapping[str, object]) -> bytes:
    """Returns the datagram of named numbers and texts.

    Raises:
        FormatError: A number that is not finite, or too much for a datagram.
    """
    try:
        data = json.dumps(dict(values), allow_nan=False, separators=(",", ":")).encode()
    except ValueError as cause:
        raise FormatError("a value that is not finite, expected numbers and texts.") from cause
    if len(data) > LONGEST:
        raise FormatError(f"{len(data)} bytes for a datagram, at most {LONGEST}.")
    return data


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    names = [name for name, _ in pairs]
    if len(set(names)) < len(names):
        raise ValueError("a name twice")
    return dict(pairs)


def _read_whole(text: str) -> float:
    return float(text) if len(text) < 400 else math.inf


def _sequence(value: float) -> int:
    if value == -1.0:
        return -1
    if not (0.0 <= value < 2.0**53 and value == int(value)):
        raise FormatError(f"seq {value:g}, expected a whole number from 0.")
    return int(value)


_SILENT: Final = 2.0
"""s without a datagram after which the other side counts as gone."""


class UdpSignals:
    """Listens on an address; answers go to the sender of the latest valid datagram.

    Args:
        host: Own address.
        port: Own port; 0 takes a free one, which ``address`` states.
        only: The only accepted host; empty accepts all.

    Raises:
        ConfigurationError: The address is not available.
    """

    def __init__(self, host: str, port: int, *, only: str = "") -> None:
        self._only = only
        self._lock = threading.Lock()
        self._inbox: Inbox[SignalSample] = Inbox()
        self._watch = SequenceState(window=10_000)
        self._sender: Address | None = None
        self._latest = float("-inf")
        self._endpoint = UdpEndpoint(host, port, self._take, closed=self._inbox.close)
        self.address = self._endpoint.address
        name = f"udp://{self.address[0]}:{self.address[1]}"
        self._health = Health(name=name, connected=False)
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
        """Returns the present counters.

        Args:
            now: s on the monotonic clock.
        """
        with self._lock:
            return replace(
                self._health,
                connected=now - self._latest < _SILENT,
                lost=self._watch.lost,
                late=self._watch.late,
                last_fault=self._health.last_fault or self._inbox.crowding,
            )

    def _take(self, data: bytes, sender: Address, host_time: float) -> None:
        """Receives a datagram in the thread of the endpoint."""
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
            self._health.received += 1
        self._inbox.put(replace(sample, flags=sample.flags | flags))

    def _refuse(self, fault: str) -> None:
        with self._lock:
            self._health.refuse(fault)
