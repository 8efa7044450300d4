"""The link to a Universal Robots controller: joints or force, read again when it comes back.

Joints and force are two connections with a recipe each: neither waits for the other, and their
clock is the controller's in both.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Final, Generic, TypeVar

import numpy as np

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online import rtde
from robotrue.online.blocks import Flag, ForceBlock, JointBlock
from robotrue.online.device_defaults import RTDE_PORT, RTDE_RATE_HZ, RTDE_SILENCE_S
from robotrue.online.link import Health, Role, StreamProtocol, StreamSettings
from robotrue.online.net_address import read_device_address
from robotrue.online.sequence import SequenceState, advance, advance_block

_RETRY: Final = (0.2, 2.0)
"""s between attempts to reach a controller that does not answer: the first, and the longest."""
_ANSWER: Final = 2.0
"""s within which a controller answers a request."""
_LOOK: Final = 0.1
"""s, at most, from close() to the end of a read."""
_CHUNK: Final = 1 << 16

B = TypeVar("B", JointBlock, ForceBlock)


@dataclass(frozen=True, slots=True, kw_only=True)
class RtdeSettings:
    """Address and rate of a controller.

    Attributes:
        name: Name in messages and health counters.
        host: Name or address of the controller.
        port: TCP.
        rate: Requested packets per second, 500 at most, 125 before e-Series.
        silence: s without a packet after which the connection is closed and opened again.
    """

    name: str
    host: str
    port: int = RTDE_PORT
    rate: float = RTDE_RATE_HZ
    silence: float = RTDE_SILENCE_S

    def __post_init__(self) -> None:
        """Checks."""
        if not (0.0 < self.rate <= 500.0 and self.silence > 2.0 / self.rate):
            raise ConfigurationError(
                f"rate {self.rate:g} Hz and silence {self.silence:g} s, expected up to 500 Hz and "
                "a silence longer than two packets.",
                source=self.name,
            )


class _RtdeLink(Generic[B]):
    """One connection with one recipe."""

    _names: tuple[str, ...]

    def __init__(self, settings: RtdeSettings) -> None:
        """Connects to nothing yet: that begins when :meth:`blocks` is first awaited."""
        self._settings = settings
        self._writer: asyncio.StreamWriter | None = None
        self._closed = self._came = self._fresh = False
        self._watch = rtde.rtde_sequence(settings.rate)
        self._health = Health(name=settings.name, connected=False)

    def health(self) -> Health:
        """Returns the present counters."""
        watch = self._watch
        return replace(
            self._health,
            lost=self._health.lost + watch.lost,
            late=self._health.late + watch.late,
        )

    async def close(self) -> None:
        """Pauses the controller and disconnects; an open :meth:`blocks` ends soon after."""
        self._closed = True
        if self._writer is not None and not self._writer.is_closing():
            with contextlib.suppress(OSError):
                self._writer.write(rtde.write_frame("P"))
            self._leave()

    async def blocks(self) -> AsyncIterator[B]:
        """Gives what the controller sends, for ever; connects again when it has gone.

        Raises:
            ConfigurationError: The controller does not have the variables, or refuses the
                protocol or the start.
        """
        wait = _RETRY[0]
        try:
            while not self._closed:
                try:
                    talk, recipe = await self._connect()
                    while (packets := await self._next(talk)) is not None:
                        wait = _RETRY[0]
                        if packets:
                            yield self._take(packets, recipe)
                except (OSError, EOFError, TimeoutError) as cause:
                    self._health.last_fault = f"connection lost: {cause or type(cause).__name__}"
                except FormatError as cause:
                    self._health.refuse(cause.message)
                finally:
                    self._leave()
                if not self._closed:
                    await asyncio.sleep(wait)
                    wait = min(2.0 * wait, _RETRY[1])
        finally:
            await self.close()

    async def _connect(self) -> tuple[_Talk, rtde.Recipe]:
        """A started stream and its recipe."""
        settings = self._settings
        async with asyncio.timeout(_ANSWER):
            reader, self._writer = await asyncio.open_connection(settings.host, settings.port)
            talk = _Talk(reader, self._writer)
            if not rtde.read_accepted(await talk.ask(rtde.write_protocol_request(), "V")):
                raise ConfigurationError(
                    f"the controller does not speak RTDE protocol {rtde.PROTOCOL}.",
                    source=settings.name,
                    hint="controller software 3.10 or 5.4 and newer.",
                )
            request = rtde.write_output_request(self._names, settings.rate)
            recipe = rtde.read_recipe(await talk.ask(request, "O"), self._names)
            if not rtde.read_accepted(await talk.ask(rtde.write_frame("S"), "S")):
                raise ConfigurationError(
                    "the controller does not start the stream.",
                    source=settings.name,
                    hint="another client may hold all its connections.",
                )
        self._fresh = self._came
        return talk, recipe

    async def _next(self, talk: _Talk) -> list[rtde.RtdePacket] | None:
        """The data packets that have come; None when closed.

        Text messages of the controller are saved as the latest fault.
        """
        until = time.monotonic() + self._settings.silence
        while not talk.packets:
            if self._closed:
                return None
            if time.monotonic() >= until:
                raise TimeoutError(f"silent for {self._settings.silence:g} s")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LOOK):
                    await talk.read()
        packets, talk.packets = list(talk.packets), deque()
        for packet in packets:
            if packet.kind == "M":
                message, source, level = rtde.read_text(packet)
                if level <= 1:  # exception or error; warnings and remarks are the pendant's
                    self._health.last_fault = f"{source}: {message}"
        return None if self._closed else [packet for packet in packets if packet.kind != "M"]

    def _take(self, packets: list[rtde.RtdePacket], recipe: rtde.Recipe) -> B:
        """The block of data packets."""
        rows = rtde.read_data(packets, recipe)
        block = self._watch_clock(self._block(rows, time.monotonic(), rate=self._settings.rate))
        self._health.connected = self._came = True
        self._health.received += len(block)
        return block

    def _block(self, rows: rtde.Rows, host_time: float, *, rate: float) -> B:
        raise NotImplementedError

    def _watch_clock(self, block: B) -> B:
        """Returns the block with the flags of its clock; samples without a time do not change it.

        The first sample after a reconnection is of another clock.
        """
        timed = np.flatnonzero((block.flags & int(Flag.CLOCK_JUMP)) == 0)
        if not len(timed):
            return block
        flags, sequence, host = block.flags.copy(), block.sequence[timed], block.host_time[timed]
        if self._fresh:
            self._fresh = False
            flags[timed[0]] |= int(self._return(int(sequence[0]), float(host[0])))
            timed, sequence, host = timed[1:], sequence[1:], host[1:]
        self._watch, odd = advance_block(self._watch, sequence, host)
        flags[timed] |= odd
        return replace(block, flags=flags)

    def _return(self, tick: int, host_time: float) -> Flag:
        """Takes the first packet after a return; returns the flags of its clock."""
        self._health.reconnects += 1
        watch, window, flags = self._watch, self._watch.window, Flag.NONE
        if watch.last is not None and tick <= watch.last:
            self._health = replace(self.health(), connected=True)
            watch = SequenceState(late_after=watch.late_after)
            flags = Flag.CLOCK_JUMP
        elif watch.last is not None:  # its clock may have gone on for as long as it was away
            away = (host_time - watch.host_time) * self._settings.rate
            watch = replace(watch, window=window + round(1.1 * away))
        watch, odd = advance(watch, tick, host_time)
        self._watch = replace(watch, window=window)
        return flags | odd

    def _leave(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
        self._health.connected = False


class RtdeSource(_RtdeLink[JointBlock]):
    """A controller as a source of joints and the pose of its tool point in base."""

    _names = rtde.JOINT_NAMES
    _block = staticmethod(rtde.rtde_joint_block)


class RtdeForce(_RtdeLink[ForceBlock]):
    """A controller as a source of the force at its tool point, in base axes."""

    _names = rtde.FORCE_NAMES
    _block = staticmethod(rtde.rtde_force_block)


class _Talk:
    """A connection: requests and their answers, one at a time, and the packets after them.

    Attributes:
        packets: Whole packets that have come.
    """

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._rest = b""
        self.packets: deque[rtde.RtdePacket] = deque()

    async def ask(self, request: bytes, kind: str) -> rtde.RtdePacket:
        """Returns the answer; text packets before it are skipped, data packets are queued."""
        self._writer.write(request)
        await self._writer.drain()
        while True:
            while not self.packets:
                await self.read()
            packet = self.packets.popleft()
            if packet.kind == kind:
                return packet
            if packet.kind != "M":
                raise FormatError(f"RTDE packet {packet.kind!r}, expected {kind!r}.")

    async def read(self) -> None:
        """Reads what has come; waits for something."""
        data = await self._reader.read(_CHUNK)
        if not data:
            raise EOFError("the controller closed it")
        packets, self._rest = rtde.split_frames(self._rest + data)
        self.packets.extend(packets)


OPTIONS: Final = {"rate": "packets per second in Hz, up to 500", "silence": "s"}


def read_rtde_address(address: str, role: Role, settings: StreamSettings) -> RtdeSource | RtdeForce:
    """Returns the joints or the forces of a Universal Robots controller.

    Raises:
        ConfigurationError: An invalid option or value.
    """
    where, options = read_device_address(address, RTDE_PORT, OPTIONS)
    made = RtdeSettings(
        name=where.shown,
        host=where.host,
        port=where.port,
        rate=options.number("rate", "Hz", default=RTDE_RATE_HZ),
        silence=options.number("silence", "s", default=RTDE_SILENCE_S),
    )
    return RtdeSource(made) if role == "robot" else RtdeForce(made)


PROTOCOL: Final = StreamProtocol(
    example="rtde://192.168.0.10?rate=500Hz",
    options=OPTIONS,
    read=read_rtde_address,
    force_rate=RTDE_RATE_HZ,
)
