"""Receives and answers datagrams in a separate thread; passes samples to the event loop.

A controller waits 4 ms for its answer. The event loop writes files, serves pages and estimates, and
any of that may take longer; so an endpoint has a thread that sleeps in ``recvfrom``, answers, and
puts its samples into an :class:`Inbox`. Nothing is dropped there: a record must have every sample.
The inbox grows while its reader is slow, and reports a fault from a stated size on.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import socket
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Final, Generic, TypeVar

from robotrue.errors import ConfigurationError

Address = tuple[str, int]
Handle = Callable[[bytes, Address, float], None]
T = TypeVar("T")

_LARGEST: Final = 65535
_BUFFER: Final = 1 << 20
"""Bytes the system may hold while the thread waits for a processor: a second of any protocol."""
_STAMP: Final = 35
"""SO_TIMESTAMPNS of Linux: s and ns of arrival come with each datagram."""
_TIMESPEC: Final = struct.Struct("@qq")
_LONGEST: Final = 1.0
"""s a datagram can have waited; a longer wait is a clock that was set."""
_WAKE: Final = 0.05
"""s between two looks at whether the endpoint was closed."""
_WAIT: Final = struct.pack("@ll", 0, round(1e6 * _WAKE))
SWITCH: Final = 0.5e-3
"""s after which Python takes a running thread off for one that waits; its own 5 ms are a cycle."""
_STAMPED: Final = sys.platform == "linux" and sys.maxsize > 2**32
TOLD: Final = 64
"""Bytes for the ancillary data of a datagram."""
CROWDED: Final = 5000
"""Samples that may wait before health reports a fault (20 s of a robot, 1 s of a force sensor)."""
_AT_ONCE: Final = 4096


class UdpEndpoint:
    """A bound socket and its thread.

    The thread requests the highest priority from the system (round robin, a low real-time
    priority); ``preferred`` states whether that was granted. It sleeps between datagrams.

    Args:
        host: Own address; ``0.0.0.0`` for all.
        port: Own port; 0 takes a free one, which ``address`` states.
        handle: Called in the thread with each datagram, its sender, and s on the monotonic clock
            when it arrived: from the system on Linux, else when the thread read it.
        closed: Called at the end of the thread; with the fault if ``handle`` raised one.

    Raises:
        ConfigurationError: The address is not available.
    """

    def __init__(
        self,
        host: str,
        port: int,
        handle: Handle,
        *,
        closed: Callable[[BaseException | None], None],
    ) -> None:
        self._handle, self._closed = handle, closed
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._socket.bind((host, port))
            tell_arrivals(self._socket)
        except (OSError, OverflowError) as cause:
            self._socket.close()
            raise ConfigurationError(
                f"{host}:{port} cannot be listened on: {cause}.",
                hint="another program on this port, or an address of another computer.",
            ) from cause
        if _STAMPED:
            # the system's own limit: one call that waits, and the interpreter lock is taken once
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _WAIT)
        else:
            self._socket.settimeout(_WAKE)
        name = self._socket.getsockname()
        self.address: Address = (str(name[0]), int(name[1]))
        self.unsent = 0
        self.preferred = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(
            target=self._serve, name=f"udp {self.address[0]}:{self.address[1]}", daemon=True
        )

    def start(self) -> None:
        """Begins to take datagrams."""
        self._thread.start()

    def send(self, data: bytes, to: Address) -> bool:
        """Sends a datagram; returns whether the system took it, and counts in ``unsent`` if not."""
        try:
            self._socket.sendto(data, to)
        except OSError:
            self.unsent += 1
            return False
        return True

    async def stop(self) -> None:
        """Ends the thread and closes the socket."""
        self._stopping.set()
        while self._thread.is_alive():
            await asyncio.sleep(_WAKE / 10.0)
        self._socket.close()

    def _serve(self) -> None:
        fault: BaseException | None = None
        self.preferred = _prefer_thread(above=1)
        latest = float("-inf")
        try:
            while not self._stopping.is_set():
                try:
                    data, waited, sender = self._take_datagram()
                except OSError:
                    # nothing came, or the system reports an unreachable receiver of an answer
                    continue
                latest = max(latest, time.monotonic() - waited)
                self._handle(data, (sender[0], sender[1]), latest)
        except Exception as raised:
            fault = raised
        finally:
            self._closed(fault)

    def _take_datagram(self) -> tuple[bytes, float, tuple[str, int]]:
        """A datagram, s that it has waited in the system, and its sender."""
        if not _STAMPED:
            data, sender = self._socket.recvfrom(_LARGEST)
            return data, 0.0, sender
        data, told, _, sender = self._socket.recvmsg(_LARGEST, TOLD)
        return data, time_waited(told), sender


class Inbox(Generic[T]):
    """Samples on their way from a thread to one reader in an event loop.

    Args:
        limit: Number that may wait before it is crowded; none is ever dropped.
        count: Number of samples of an item.
    """

    def __init__(self, limit: int = CROWDED, count: Callable[[T], int] = lambda _: 1) -> None:
        self._items: deque[T] = deque()
        self._limit, self._count = limit, count
        self._put = self._taken = 0
        self._waiter: tuple[asyncio.AbstractEventLoop, asyncio.Future[None]] | None = None
        self._over = False
        self._fault: BaseException | None = None

    def put(self, item: T) -> None:
        """Adds a sample; from any thread."""
        self._put += self._count(item)
        self._items.append(item)
        self._wake()

    def close(self, fault: BaseException | None = None) -> None:
        """Closes the inbox: no more samples will come; from any thread."""
        self._fault = self._fault or fault
        self._over = True
        self._wake()

    @property
    def waiting(self) -> int:
        """Number of queued samples."""
        return self._put - self._taken

    @property
    def crowding(self) -> str:
        """Returns a warning about a slow reader; empty while the queue is short."""
        if self.waiting <= self._limit:
            return ""
        return f"{self.waiting} samples wait to be read, more than {self._limit}"

    async def take(self) -> list[T]:
        """Returns all that wait, at most 4096, in order; waits for one. Empty after the end.

        Raises:
            BaseException: What ended the thread that filled it.
        """
        loop = asyncio.get_running_loop()
        while True:
            over = self._over
            items = [self._items.popleft() for _ in range(min(_AT_ONCE, len(self._items)))]
            if items:
                self._taken += sum(map(self._count, items))
                return items
            if over:
                if self._fault is not None:
                    raise self._fault
                return []
            future = loop.create_future()
            self._waiter = (loop, future)
            # items put between the check and the waiter woke no reader
            if self._items or self._over:
                self._waiter = None
                continue
            await future

    def _wake(self) -> None:
        waiter, self._waiter = self._waiter, None
        if waiter is not None:
            # a loop that has ended needs no waking
            with contextlib.suppress(RuntimeError):
                waiter[0].call_soon_threadsafe(_done, waiter[1])


def tell_arrivals(link: socket.socket) -> None:
    """Requests the arrival time of each datagram from the system, where available."""
    if _STAMPED:
        link.setsockopt(socket.SOL_SOCKET, _STAMP, 1)


def time_waited(told: list[tuple[int, int, bytes]]) -> float:
    """Returns s since a datagram arrived, from its ancillary data; 0 without an arrival time."""
    stamp = next((data for _, kind, data in told if kind == _STAMP), b"")
    if len(stamp) != _TIMESPEC.size:
        return 0.0
    seconds, nanoseconds = _TIMESPEC.unpack(stamp)
    passed: float = (time.time_ns() - seconds * 1_000_000_000 - nanoseconds) * 1e-9
    return passed if 0.0 <= passed < _LONGEST else 0.0


def _prefer_thread(above: int = 0) -> bool:
    """Requests real-time priority for this thread; returns False where that is not permitted.

    Args:
        above: Levels above the lowest real-time priority.
    """
    if sys.platform != "linux":
        return False
    # what this thread starts is to be as everything else
    policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
    least = os.sched_get_priority_min(os.SCHED_RR)
    for level in {least + above: None, least: None}:  # the lowest may be all that is allowed
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, policy, os.sched_param(level))
            return True
    return False


def _done(future: asyncio.Future[None]) -> None:
    if not future.done():
        future.set_result(None)


@contextlib.contextmanager
def prompt_answers(*, first: bool = False, switch: float = SWITCH) -> Iterator[None]:
    """Keeps the interpreter from delaying an answer while this context lasts.

    Objects that exist at the start are excluded from garbage collection, which stops every thread;
    a thread that computes yields to one that answers after ``switch``, not after 5 ms. Both hold
    for the whole process: enter it once, when all is opened, around the loop.

    Args:
        first: The thread that enters runs before other programs, too, where the system allows it:
            it may hold the interpreter when an answer is due. Only for a loop that sleeps most of
            the time; one that computes would block other programs.
        switch: s; a shorter one costs threads that compute time.
    """
    before = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(switch)
    preferred = first and _prefer_thread()
    try:
        yield
    finally:
        if preferred:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        sys.setswitchinterval(before)
        gc.unfreeze()
