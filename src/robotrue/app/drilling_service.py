"""The service beside a drilling machine: datagrams in, answers out, until it is told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Mapping

from robotrue.app.drilling_desk import Desk
from robotrue.app.drilling_robot import follow_joints
from robotrue.app.presentation import count
from robotrue.app.reporting import Message
from robotrue.core.provenance import mark_sentence
from robotrue.drilling.drill_defaults import PORT
from robotrue.errors import ConfigurationError
from robotrue.online.net_address import net_address
from robotrue.online.signals import UdpSignals, write_signals


async def serve_desk(desk: Desk, address: str, seconds: float | None, *, begin: str) -> None:
    """Answers what comes in until it is told to stop, or for a time.

    Args:
        desk: Takes values and gives answers.
        address: ``udp://HOST:PORT``, where the machine's values come in.
        seconds: s, then it ends; None for until Ctrl-C.
        begin: A line said once it listens; empty for none.

    Raises:
        ConfigurationError: Another kind of address.
    """
    where = net_address(address, default_port=PORT)
    where.read_options({"from": "HOST, the only one that is listened to"})
    if where.scheme != "udp":
        raise ConfigurationError(
            f"--from {where.scheme}://, expected udp://.", hint=f"--from udp://0.0.0.0:{PORT}"
        )
    source = UdpSignals(where.host, where.port, only=where.options.get("from", ""))
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            loop.add_signal_handler(name, stop.set)
    listening = f"listening on udp://{source.address[0]}:{source.address[1]}; Ctrl-C ends"
    for line in filter(None, (listening, mark_sentence(desk.provenance), begin)):
        desk.reporter.report(Message(line))
    ended = asyncio.create_task(stop.wait())
    async with follow_joints(desk.robot) as joints:
        work = asyncio.create_task(_answer(desk, source))
        waits = {work, ended} if joints is None else {work, ended, joints}
        try:
            done, _ = await asyncio.wait(
                waits, timeout=seconds, return_when=asyncio.FIRST_COMPLETED
            )
        finally:
            health = source.health(time.monotonic())
            await source.close()
            ended.cancel()
        await work
        if joints in done:
            await joints
    if health.refused:
        unread = f"{count(health.refused, 'datagram')} not read; the last: {health.last_fault}"
        desk.reporter.report(Message(unread))


async def _answer(desk: Desk, source: UdpSignals) -> None:
    async for sample in source.samples():
        document = desk.take(sample)
        if document is not None:
            source.answer(write_signals(_flat(document)))


def _flat(document: Mapping[str, object]) -> dict[str, object]:
    """An answer for a control: numbers and texts only."""
    out: dict[str, object] = {}
    for name, value in document.items():
        if name == "notes" and isinstance(value, list):
            out["said"] = " ".join(value)[:1000]
        elif name == "shift_deg" and isinstance(value, list):
            out |= {"shift_a_deg": value[0], "shift_b_deg": value[1]}
        else:
            out[name] = int(value) if isinstance(value, bool) else value
    return out
