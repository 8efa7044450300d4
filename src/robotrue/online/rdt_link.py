"""The link to an ATI Net F/T or Axia sensor: requests records, again after a silence.

The sensor sends from the first request to the last and knows one client only. Datagrams that have
piled up are read at once and become one block. The stream is never taken as it is: without the
sensor's own scale nothing is read, since a count looks like a force.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Flag, ForceBlock
from robotrue.online.device_defaults import RDT_PORT, RDT_SILENCE_S
from robotrue.online.link import FORCE_FRAMES, Health, Role, StreamProtocol, StreamSettings
from robotrue.online.net_address import read_device_address
from robotrue.online.rdt import (
    RECORD,
    RdtCommand,
    RdtDevice,
    RdtScale,
    arrival_times,
    checked_rate,
    decode_records,
    parse_netftapi,
    parse_rate,
    rdt_block,
    rdt_sequence,
    write_request,
)
from robotrue.online.sequence import SequenceState, advance_block
from robotrue.online.udp import TOLD, tell_arrivals, time_waited

Told = list[tuple[int, int, bytes]]
_DATAGRAM: Final = 40 * RECORD.itemsize
"""Bytes of the longest datagram a sensor sends."""
_MOST: Final = 512
"""Records read at once, at most."""
_KERNEL: Final = 1 << 22
"""Requested size of the system's buffer for datagrams, bytes; it may grant less."""
_LOOK: Final = 0.1
"""s, at most, from close() to the end of a read."""
_RETRY: Final = (0.2, 2.0)
"""s between attempts to reach a sensor that does not answer: the first, and the longest."""
_TRIAL: Final = 1.0
"""s of the stream after which its rate is compared with what was stated."""
_RATE_OFF: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class RdtSettings:
    """Address of a sensor and the scale of its records.

    Attributes:
        name: Name in messages and health counters.
        host: Name or address of the sensor.
        port: UDP.
        scale: Counts per unit; None if ``page`` states it.
        page: ``http://...`` address of the sensor's ``netftapi2.xml``, or empty.
        device: Family.
        rate: Records per second; None if ``page`` states it.
        frame: Frame of the axes: "sensor" unless the sensor itself turns them.
        silence: s without a record after which records are requested again.
        gather: s for which datagrams pile up before they are read.
    """

    name: str
    host: str
    port: int = RDT_PORT
    scale: RdtScale | None = None
    page: str = ""
    device: RdtDevice = RdtDevice.NET
    rate: float | None = None
    frame: str = "sensor"
    silence: float = RDT_SILENCE_S
    gather: float = 0.004

    def __post_init__(self) -> None:
        """Checks."""
        if self.scale is None and not self.page:
            raise ConfigurationError(
                "the scale of the sensor's counts is not stated; counts are never used as newtons.",
                source=self.name,
                hint="scale=netftapi2.xml, saved from http://SENSOR/netftapi2.xml, or scale=http.",
            )
        if self.page and not self.page.startswith("http://"):
            raise ConfigurationError(
                f"page {self.page!r}, expected http://SENSOR/netftapi2.xml.", source=self.name
            )
        if self.rate is None and not self.page:
            raise ConfigurationError(
                "the sensor's records per second are not stated.",
                source=self.name,
                hint="rate=7000Hz, as on the sensor's Communications page (RDT Output Rate).",
            )
        if self.rate is not None:
            checked_rate(self.rate)
        if not (self.silence > 0.0 and 0.0 <= self.gather < self.silence):
            raise ConfigurationError(
                f"silence {self.silence:g} s and gather {self.gather:g} s, expected both above "
                "zero and the first longer.",
                source=self.name,
            )


class RdtSource:
    """A sensor as a source of :class:`~robotrue.online.blocks.ForceBlock`."""

    def __init__(self, settings: RdtSettings) -> None:
        """Sends nothing; the first request goes out when :meth:`blocks` is first awaited."""
        self._settings = settings
        self._scale = settings.scale
        self._rate = settings.rate
        self._buffer = bytearray(_MOST * RECORD.itemsize + _DATAGRAM)
        self._socket: socket.socket | None = None
        self._reading = self._closed = self._came = False
        self._watch = SequenceState()
        self._before: tuple[int, int] | None = None
        self._emptied = float("-inf")
        self._waited = 0.0
        self._trial: tuple[float, int] | None = None
        self._health = Health(name=settings.name, connected=False)

    def health(self) -> Health:
        """Returns the present counters."""
        return replace(
            self._health,
            lost=self._health.lost + self._watch.lost,
            late=self._health.late + self._watch.late,
        )

    async def close(self) -> None:
        """Stops the sensor; an open :meth:`blocks` ends soon after."""
        self._closed = True
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.send(write_request(RdtCommand.STOP))
            if not self._reading:
                self._leave()

    async def blocks(self) -> AsyncIterator[ForceBlock]:
        """Yields the sensor's records without end; requests them again when it falls silent.

        Raises:
            ConfigurationError: Records at another rate than stated, or a page without rate.
            FormatError: The sensor's page does not state the counts per unit.
        """
        wait = _RETRY[0]
        try:
            while not self._closed:
                try:
                    scale, rate = await self._find_scale_and_rate()
                    self._enter(rate)
                    while (block := await self._next(scale, rate)) is not None:
                        wait = _RETRY[0]
                        yield block
                    continue
                except OSError as cause:
                    self._health.last_fault = f"not reached: {cause.strerror or cause}"
                finally:
                    self._leave()
                await asyncio.sleep(wait)
                wait = min(2.0 * wait, _RETRY[1])
        finally:
            await self.close()

    async def _find_scale_and_rate(self) -> tuple[RdtScale, float]:
        """Scale and rate, fetched from the sensor where the settings leave it to the page."""
        page = self._settings.page
        if page and (self._scale is None or self._rate is None):
            data = await asyncio.to_thread(_fetch_page, page)
            self._scale = self._scale or parse_netftapi(data, page)
            self._rate = self._rate or parse_rate(data, page)
        if self._scale is None or self._rate is None:
            raise ConfigurationError(
                "the sensor's page does not state its records per second.",
                source=page,
                hint="rate=7000Hz in the address.",
            )
        return self._scale, self._rate

    def _enter(self, rate: float) -> None:
        """Opens the socket and requests records; what comes after belongs to a new clock."""
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket = link
        link.setblocking(False)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _KERNEL)
        tell_arrivals(link)
        link.connect((self._settings.host, self._settings.port))
        link.send(write_request(RdtCommand.START))
        self._health = self.health()
        self._watch = rdt_sequence(rate)
        self._before, self._trial = None, None
        self._emptied = time.monotonic()

    def _leave(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._health.connected = False

    async def _next(self, scale: RdtScale, rate: float) -> ForceBlock | None:
        """The next block, or None when the sensor is silent or the source closed."""
        if self._trial is not None:
            await asyncio.sleep(self._settings.gather)
        size = await self._read()
        if not size:
            return None
        now = time.monotonic() - self._waited
        with memoryview(self._buffer) as whole, whole[:size] as part:
            records = decode_records(bytes(part))
        self._emptied, earliest = now, min(self._emptied, now)
        rdt = records["rdt"].astype(np.int64)
        came = arrival_times(rdt, now, earliest, rate)
        block = rdt_block(
            records,
            scale,
            came,
            self._flags(rdt, came),
            device=self._settings.device,
            rate=rate,
            frame=self._settings.frame,
            before=self._before,
        )
        self._before = int(rdt[-1]), int(records["ft"][-1])
        self._report(block)
        self._check_rate(block, rate)
        return block

    async def _read(self) -> int:
        """Bytes of whole records in the buffer; 0 after silence."""
        link, loop = self._socket, asyncio.get_running_loop()
        if link is None:
            return 0
        until = time.monotonic() + self._settings.silence
        size, self._reading = 0, True
        try:
            with memoryview(self._buffer) as view:
                while not size and not self._closed:
                    left = until - time.monotonic()
                    if left <= 0.0:
                        self._health.last_fault = f"silent for {self._settings.silence:g} s"
                        return 0
                    try:
                        async with asyncio.timeout(min(left, _LOOK)):
                            got = await loop.sock_recv_into(link, view[: _DATAGRAM + 1])
                    except TimeoutError:
                        continue
                    size = self._drain(link, view, self._whole_size(got))
        finally:
            self._reading = False
        return 0 if self._closed else size

    def _drain(self, link: socket.socket, view: memoryview, size: int) -> int:
        """Reads all available records after those already read."""
        most = _MOST * RECORD.itemsize
        recv_into, whole = _make_receiver(link), RECORD.itemsize
        told: Told = []
        while size < most:
            try:
                got, told = recv_into(view[size : size + _DATAGRAM + 1])
            except BlockingIOError:
                break
            size += got if got == whole else self._whole_size(got)
        # a computer that was busy reads late what came in time
        self._waited = time_waited(told)
        return size

    def _whole_size(self, got: int) -> int:
        """The size of a datagram if it holds records, else 0."""
        if got and got <= _DATAGRAM and got % RECORD.itemsize == 0:
            return got
        self._health.refuse(f"a datagram of {got} bytes, no records")
        return 0

    def _flags(self, rdt: IntArray, came: Array) -> IntArray:
        """Returns flags from the record count; a reconnection restarts the clock."""
        fresh = self._watch.last is None
        self._watch, flags = advance_block(self._watch, rdt, came)
        if fresh and self._came:
            flags[0] |= int(Flag.CLOCK_JUMP)
            self._health.reconnects += 1
        self._came = True
        return flags

    def _report(self, block: ForceBlock) -> None:
        self._health.connected = True
        self._health.received += len(block)
        ill = np.flatnonzero(block.flags & int(Flag.SENSOR_FAULT | Flag.SATURATED))
        if len(ill):
            flags = Flag(int(block.flags[ill[-1]]))
            self._health.last_fault = (
                f"record {block.sequence[ill[-1]]}: {flags.name}, status "
                f"{block.status[ill[-1]]:#010x}"
            )

    def _check_rate(self, block: ForceBlock, rate: float) -> None:
        """A sensor set to another rate than stated would be read with a wrong clock, for ever."""
        now, total = float(block.host_time[-1]), self._watch.total
        if self._trial is None:
            self._trial = now, total
        begun, first = self._trial
        if not _TRIAL <= now - begun < 2.0 * _TRIAL or self._watch.jumps:
            return
        seen = (total - first) / (now - begun)
        if abs(seen / rate - 1.0) > _RATE_OFF:
            raise ConfigurationError(
                f"the sensor sends about {seen:.0f} records per second, {rate:g} are stated.",
                source=self._settings.name,
                hint=f"rate={seen:.0f}Hz, or the RDT Output Rate on the sensor's page.",
            )


def _make_receiver(link: socket.socket) -> Callable[[memoryview], tuple[int, Told]]:
    """Returns a function that reads a datagram into a view: its size, and ancillary data."""
    if not hasattr(link, "recvmsg_into"):  # Windows
        return lambda view: (link.recv_into(view), [])
    recvmsg_into = link.recvmsg_into

    def read(view: memoryview) -> tuple[int, Told]:
        got, told, _, _ = recvmsg_into((view,), TOLD)
        return got, told

    return read


def _fetch_page(page: str) -> bytes:
    try:
        with urllib.request.urlopen(page, timeout=2.0) as answer:  # noqa: S310 (http, checked)
            return bytes(answer.read(1 << 20))
    except urllib.error.HTTPError as cause:
        raise OSError(f"{page}: {cause.code} {cause.reason}") from cause
    except urllib.error.URLError as cause:
        raise OSError(f"{page}: {cause.reason}") from cause


OPTIONS: Final = {
    "scale": "FILE or http, netftapi2.xml of the sensor",
    "rate": "records per second in Hz",
    "device": "net or axia",
    "frame": "sensor, tool or base",
    "silence": "s",
}


def read_rdt_address(address: str, role: Role, settings: StreamSettings) -> RdtSource:
    """Returns the forces of an ATI sensor.

    Raises:
        ConfigurationError: An invalid option or value, or no scale.
        FormatError: A scale that cannot be read.
    """
    where, options = read_device_address(address, RDT_PORT, OPTIONS)
    stated = options.text("scale")
    page, scale, rate = "", None, None
    if stated == "http":
        page = f"http://{where.host}/netftapi2.xml"
    elif stated is not None and stated.startswith("http://"):
        page = stated
    elif stated is not None:
        data = read_bytes(stated)
        scale, rate = parse_netftapi(data, stated), parse_rate(data, stated)
    return RdtSource(
        RdtSettings(
            name=where.shown,
            host=where.host,
            port=where.port,
            scale=scale,
            page=page,
            device=RdtDevice(options.word("device", [d.value for d in RdtDevice]) or "net"),
            rate=options.number("rate", "Hz") if options.has("rate") else rate,
            frame=options.word("frame", FORCE_FRAMES) or "sensor",
            silence=options.number("silence", "s", default=RDT_SILENCE_S),
        )
    )


PROTOCOL: Final = StreamProtocol(
    example="rdt://192.168.1.1?scale=netftapi2.xml&rate=7000Hz",
    options=OPTIONS,
    read=read_rdt_address,
    lacks={"robot": "a force sensor knows no joints"},
)
