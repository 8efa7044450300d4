"""Robot controllers answered by a separate process, as sources of this one.

Python runs one thread at a time. Where the service estimates, records and serves pages, an answer
that is due waits for all of these; so :mod:`robotrue.online.answering` gives it a process that has
nothing else to do. Linux only: sockets that keep messages whole, and one monotonic clock for both.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace
from typing import Final, Generic, TypeVar

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online import answering_wire as wire
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.guard import CorrectionGuard, CorrectionLimits, GuardState
from robotrue.online.link import Health, LinkState
from robotrue.online.record_frames import frame_content
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.robot_link import Turnaround
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import Address, Inbox

B = TypeVar("B", JointBlock, ForceBlock)
AVAILABLE: Final = sys.platform == "linux" and bool(sys.executable)
"""Whether this computer can have an answering process; else a thread answers."""
_START: Final = 30.0
"""s that it has to listen; a second on a computer with nothing else to do."""
_END: Final = 20.0
"""s to ramp a correction to zero, deliver the last samples and end."""
_LOOK: Final = 0.005
_PATIENCE: Final = 0.2
"""s that a request may wait for a process that is not reading."""


def answering_guard(
    limits: CorrectionLimits, mode: CorrectionMode
) -> wire.RemoteGuard | CorrectionGuard:
    """Returns the guard for a live robot: in its answering process, or here where there is none."""
    return wire.RemoteGuard(limits, mode) if AVAILABLE else CorrectionGuard(limits, mode)


class RemoteStream(Generic[B]):
    """A stream that the answering process reads, as a source of blocks; ends with the link.

    Args:
        name: Name in health counters.
        waiting: Samples that may wait for their reader before health reports a fault.
        restart: Awaited before reading: restarts a process that has ended by itself.

    Attributes:
        inbox: Blocks received.
        counters: Counters of the process.
    """

    def __init__(self, name: str, waiting: int, restart: Callable[[], Awaitable[None]]) -> None:
        self._waiting, self._restart = waiting, restart
        self.counters = Health(name=name, connected=False)
        self.begin()

    def begin(self) -> None:
        """Begins, the first time or after a process that has ended."""
        self.inbox: Inbox[B] = Inbox(self._waiting, len)
        self._fault = ""

    def end(self, fault: RobotrueError | None) -> None:
        """Closes the stream: no more blocks will come."""
        self.counters = replace(self.counters, connected=False)
        self._fault = "" if fault is None else fault.message
        self.inbox.close(fault)

    async def blocks(self) -> AsyncIterator[B]:
        """Gives samples as they come; ends when the link is closed.

        Raises:
            RobotrueError: A correction that this controller cannot take, or a process that ended.
        """
        await self._restart()
        while found := await self.inbox.take():
            for block in wire.join_blocks(found):
                yield block

    async def close(self) -> None:
        """Gives no more; the link itself stays open."""
        self.inbox.close()

    def health(self) -> Health:
        """Returns the counters of the latest report."""
        fault = self.inbox.crowding or self._fault or self.counters.last_fault
        return replace(self.counters, last_fault=fault)


class AnsweringLink:
    """A controller as a source of :class:`~robotrue.online.blocks.JointBlock`, answered elsewhere.

    Its process listens and answers when this returns. If it ends by itself, ``blocks`` raises, and
    restarts it when called again: the correction that the robot held ramps to zero and stays there
    until it is armed.

    Args:
        settings: Of the link, one of :data:`~robotrue.online.answering_wire.LinkSettings`.
        guard: Called for each answer, in the other process; None corrects nothing.

    Raises:
        ConfigurationError: As the link itself, or the process did not start.
    """

    def __init__(self, settings: wire.LinkSettings, guard: wire.RemoteGuard | None = None) -> None:
        if not AVAILABLE:
            raise ConfigurationError(
                "an answering process on a system other than Linux.",
                hint="settings.open_link(), which answers in a thread.",
            )
        if guard is not None:
            settings.check_corrections()
            guard.connect(self._tell)
        self.settings, self._guard = settings, guard
        self._link = LinkState(watch=SequenceState())
        self._before: GuardState | None = None
        self.address: Address = (settings.host, 0)
        self._joints: RemoteStream[JointBlock] = RemoteStream(
            settings.name, settings.waiting, self._restart_process
        )
        self._force: RemoteStream[ForceBlock] | None = None
        self.preferred = False
        self._closing = False
        self._died = ""
        self._again = asyncio.Lock()
        self._start(None)

    @property
    def turnaround(self) -> Turnaround:
        """Returns the answer times over all answering processes of this link."""
        return Turnaround.of(self._link.turnaround, self._link.slowest)

    @property
    def process_id(self) -> int:
        """Process id of the current answering process."""
        return self._process.pid

    def blocks(self) -> AsyncIterator[JointBlock]:
        """Gives samples as they come; ends when closed. As :meth:`RemoteStream.blocks`."""
        return self._joints.blocks()

    def force(self) -> RemoteStream[ForceBlock]:
        """Returns the force in the same messages as a separate source; always the same object.

        Raises:
            ConfigurationError: The controller sends none.
        """
        if not self.settings.sends_force:
            raise ConfigurationError(f"force of {self.settings.name}, which sends none.")
        if self._force is None:
            self._force = RemoteStream(
                f"{self.settings.name} force", self.settings.waiting, self._restart_process
            )
            self._tell(wire.LinkRequest(do="force"))
        return self._force

    async def close(self) -> None:
        """Ramps the correction to zero at its rate, and ends the process."""
        async with self._again:
            self._closing = True
            self._tell(wire.LinkRequest(do="close"))
            until = time.monotonic() + _END
            while self._thread.is_alive():
                if time.monotonic() > until:
                    self._process.kill()
                await asyncio.sleep(_LOOK)
            self._pipe.close()

    def health(self) -> Health:
        """Returns the counters of the latest report."""
        return self._joints.health()

    def _start(self, before: wire.EndedLink | None) -> None:
        """Starts a process, and waits until it listens."""
        settings = self.settings
        if before is not None:
            settings = replace(settings, port=self.address[1])
        self._pipe, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other:
            # a separate process group: Ctrl-C is for the service
            self._process = subprocess.Popen(  # noqa: S603 (our own interpreter and module)
                [sys.executable, "-P", "-m", "robotrue.online.answering", str(other.fileno())],
                pass_fds=(other.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
                process_group=0,
            )
        guard = self._guard
        opening = wire.Opening(
            settings=settings,
            limits=None if guard is None else guard.limits,
            mode=None if guard is None else guard.mode,
            before=before,
        )
        try:
            self.address, report = self._open_process(opening)
        except BaseException:
            self._pipe.close()
            self._process.kill()
            self._process.wait()
            raise
        self._joints.begin()
        self._died = ""
        self._take_report(report)
        self._thread = threading.Thread(
            target=self._listen, name=f"answers {settings.name}", daemon=True
        )
        self._thread.start()
        if self._force is not None:
            self._force.begin()
            self._tell(wire.LinkRequest(do="force"))

    def _open_process(self, opening: wire.Opening) -> tuple[Address, wire.AnsweringReport]:
        """Returns where it listens, and its first report."""
        self._pipe.settimeout(_START)
        data, slow = b"", ""
        try:
            self._pipe.send(wire.write_message(opening))
            data = self._pipe.recv(wire.MOST)
        except TimeoutError:
            slow = f" within {_START:g} s"
        except OSError:
            pass
        if not data:
            raise ConfigurationError(
                f"the process that answers {self.settings.name} did not start{slow}.",
                hint=f"{sys.executable} -P -m robotrue.online.answering",
            )
        self._pipe.settimeout(None)
        report, _ = wire.read_message(data, wire.AnsweringReport)
        if report.fault is not None or report.address is None:
            raise (
                ConfigurationError("no address.") if report.fault is None else report.fault.error()
            )
        return report.address, report

    async def _restart_process(self) -> None:
        """Starts a new process where one has ended by itself."""
        async with self._again:
            if not self._died or self._closing:
                return
            self._pipe.close()
            before = wire.EndedLink(link=self._link, guard=self._before, why=self._died)
            await asyncio.to_thread(self._start, before)

    def _tell(self, request: wire.LinkRequest) -> None:
        """Sends a request to the process; one that does not read misses what is wanted of it."""
        if self._died:
            return
        data = wire.write_message(request)
        # a correction that has to wait is old; all else may wait for a moment
        until = time.monotonic() + (0.0 if request.do == "want" else _PATIENCE)
        while True:
            try:
                self._pipe.send(data, socket.MSG_DONTWAIT)
            except BlockingIOError:
                if time.monotonic() < until:
                    time.sleep(_LOOK)
                    continue
            except OSError:
                pass  # it has ended; the listening thread reports it
            return

    def _listen(self) -> None:
        """Receives the reports of the process until it ends; in a thread."""
        fault: RobotrueError | None = None
        while True:
            try:
                data = self._pipe.recv(wire.MOST)
            except ConnectionError:
                continue  # raised once for unread data; the remaining reports and the end follow
            except OSError:
                break
            if not data:
                break
            report, frame = wire.read_message(data, wire.AnsweringReport)
            if report.fault is not None:
                fault = report.fault.error()
            self._take_report(report)
            if frame:
                self._take(frame)
        self._handle_end(fault)

    def _take(self, frame: bytes) -> None:
        block = frame_content(frame)
        if isinstance(block, JointBlock):
            self._joints.inbox.put(block)
        elif self._force is not None and isinstance(block, ForceBlock):
            self._force.inbox.put(block)

    def _take_report(self, report: wire.AnsweringReport) -> None:
        if self._guard is not None and report.guard is not None:
            self._guard.take_state(report.guard)
        if report.link is not None and report.health is not None:
            self._link, self.preferred = report.link, report.preferred
            self._joints.counters = report.health
            if self._force is not None and report.force is not None:
                self._force.counters = report.force
        elif report.watch is not None:
            self._link = replace(self._link, watch=report.watch, peer=report.peer)

    def _handle_end(self, fault: RobotrueError | None) -> None:
        code = self._process.wait()
        if fault is None and not self._closing:
            how = f"exit code {code}"
            if code < 0:
                with contextlib.suppress(ValueError):
                    how = signal.Signals(-code).name
            fault = RobotrueError(
                f"the process that answers {self.settings.name} has ended ({how}): "
                "the controller has no answers until another has started."
            )
        if fault is not None:
            if self._guard is not None:
                self._before = self._guard.mark_ended(fault.message)
            self._died = fault.message
        for stream in (self._joints, self._force):
            if stream is not None:
                stream.end(fault)
