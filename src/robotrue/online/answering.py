"""The process that answers a robot controller, and does nothing else.

``python -m robotrue.online.answering FD`` is started by :mod:`robotrue.online.answering_link`, with
one end of a socket pair. It owns the controller's socket, the guard and the answers; samples and
counters go to the service, what is wanted comes from it. It imports little, and requests a high
priority: real-time where allowed, else a better nice value, else neither.

When the service is gone, the correction goes to zero at its rate and the process ends.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import os
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from robotrue.errors import RobotrueError
from robotrue.online import answering_wire as wire
from robotrue.online.blocks import Block, ForceBlock
from robotrue.online.guard import CorrectionGuard, GuardState
from robotrue.online.link import ForceWithJoints, StreamSource
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.robot_link import RobotLink
from robotrue.online.udp import prompt_answers

_BEAT: Final = 0.03
"""s between two messages with all counters; a controller is gone after 0.1 s of silence."""
_GATHER: Final = 0.01
"""s for which samples are gathered before they are sent on, while no correction is held."""
_SWITCH: Final = 20e-6
"""s after which the loop's thread yields to the thread that answers."""
_RESIDENT: Final = 1
"""MCL_CURRENT: what is in memory stays there."""
_NICE: Final = -10
_LAST: Final = 10.0
"""s that the last samples have on their way to a slow service."""


def main(descriptor: int) -> None:
    """Answers until the service stops it or has ended."""
    # Ctrl-C and the end of a session are for the service: it closes the link, or it is gone
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE)
    with socket.socket(fileno=descriptor) as pipe:
        opening, _ = wire.read_message(pipe.recv(wire.MOST), wire.Opening)
        try:
            guard, link = _open_link(opening)
        except RobotrueError as refused:
            pipe.send(
                wire.write_message(wire.AnsweringReport(fault=wire.AnsweringFault.of(refused)))
            )
            return
        pipe.setblocking(False)
        _stay_in_memory()
        with prompt_answers(first=True, switch=_SWITCH):
            asyncio.run(_Answering(pipe, link, guard).run())


def _stay_in_memory() -> None:
    """Keeps what is loaded from being fetched again while an answer is due; where it is allowed."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).mlockall(_RESIDENT)


def _open_link(opening: wire.Opening) -> tuple[CorrectionGuard | None, RobotLink[Any]]:
    guard, before = None, opening.before
    if opening.limits is not None and opening.mode is not None:
        guard = CorrectionGuard(opening.limits, opening.mode)
        if before is not None and before.guard is not None:
            guard.resume(before.guard, before.why)
    return guard, opening.settings.open_link(guard, None if before is None else before.link)


class _Answering:
    """The loop next to the answering thread: samples and counters out, requests in."""

    def __init__(
        self, pipe: socket.socket, link: RobotLink[Any], guard: CorrectionGuard | None
    ) -> None:
        self._pipe, self._link, self._guard = pipe, link, guard
        self._force: StreamSource[ForceBlock] | None = None
        self._sending = asyncio.Lock()
        self._alone = False
        self._told = float("-inf")
        self._pumps: list[asyncio.Task[None]] = []

    async def run(self) -> None:
        """Serves until closed, left alone, or until the link has failed."""
        await self._send(lambda: replace(self._report(), address=self._link.address))
        self._pump(self._link.blocks())
        asked = asyncio.create_task(self._serve_requests())
        beat = asyncio.create_task(self._beat())
        await asyncio.wait({asked, *self._pumps}, return_when=asyncio.FIRST_COMPLETED)
        await self._link.close()
        await asyncio.wait(self._pumps, timeout=_LAST)
        beat.cancel()
        asked.cancel()
        await self._send(self._report)
        for pump in self._pumps:
            if pump.done():
                pump.result()

    async def _serve_requests(self) -> None:
        """Serves the service's requests until it closes the socket or ends."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                data = await loop.sock_recv(self._pipe, wire.MOST)
            except ConnectionError:
                continue  # reported once for data the service left unread; the end follows
            if not data:
                self._alone = True
                return
            request, _ = wire.read_message(data, wire.LinkRequest)
            if request.do == "close":
                return
            if not self._fulfil(request):
                await self._send(self._report)

    def _fulfil(self, request: wire.LinkRequest) -> bool:
        """Executes one request; returns False if the service needs a status report at once."""
        guard = self._guard
        if (
            request.do == "force"
            and isinstance(self._link, ForceWithJoints)
            and self._force is None
        ):
            self._force = self._link.force()
            self._pump(self._force.blocks())
        elif guard is None:
            return True
        elif request.do == "want":
            shift, turn = np.array(request.shift), np.array(request.turn)
            wanted = Correction(shift=shift, turn=turn, mode=CorrectionMode.ABSOLUTE)
            guard.want(wanted, request.time)
            return True
        elif request.do == "fault":
            guard.fault(request.why)
        elif request.do == "release":
            guard.release()
        elif request.do == "rearm":
            guard.rearm()
        return False

    def _pump(self, blocks: AsyncIterator[Block]) -> None:
        self._pumps.append(asyncio.create_task(self._pump_blocks(blocks)))

    async def _pump_blocks(self, blocks: AsyncIterator[Block]) -> None:
        try:
            async for block in blocks:
                # right after an answer there is time for the counters
                due = time.monotonic() - self._told >= _BEAT
                for frame in wire.frames(block):
                    await self._send(self._report if due else self._brief, frame)
                    due = False
                # every message wakes the service; a held correction is reported at once
                if self._guard is None or self._guard.at_rest:
                    await asyncio.sleep(_GATHER)
        except RobotrueError as fault:
            failed = wire.AnsweringReport(
                guard=self._guard_state(), fault=wire.AnsweringFault.of(fault)
            )
            await self._send(lambda: failed)

    async def _beat(self) -> None:
        """Reports the counters of a controller that is silent."""
        while True:
            await asyncio.sleep(_BEAT)
            if time.monotonic() - self._told >= 1.3 * _BEAT:
                await self._send(self._report)

    async def _send(self, report: Callable[[], wire.AnsweringReport], frame: bytes = b"") -> None:
        """Sends a report, waiting while the service is slow; sends nothing once it has ended."""
        if self._alone:
            return
        async with self._sending:
            try:
                data = wire.write_message(report(), frame)
                await asyncio.get_running_loop().sock_sendall(self._pipe, data)
            except OSError:
                self._alone = True

    def _guard_state(self) -> GuardState | None:
        return None if self._guard is None else self._guard.state()

    def _brief(self) -> wire.AnsweringReport:
        """Returns the state of the last answers that a successor needs if this process ends now."""
        watch, peer = self._link.seen
        return wire.AnsweringReport(watch=watch, peer=peer, guard=self._guard_state())

    def _report(self) -> wire.AnsweringReport:
        self._told = time.monotonic()
        return wire.AnsweringReport(
            link=self._link.state(),
            guard=self._guard_state(),
            health=self._link.health(),
            force=None if self._force is None else self._force.health(),
            preferred=self._link.preferred,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]))
