"""A Universal Robots controller to practise with: RTDE protocol 2 over TCP, several clients.

Simulated throughout. It ticks 500 times a second; a client gets every k-th tick, as requested.
Variables it does not have are answered ``NOT_FOUND``, as the real one does.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online import rtde
from robotrue.online.device_defaults import RTDE_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST
from robotrue.simulation.online_faults import Fault, FaultKind, FaultyWire, clock_leap, showing
from robotrue.simulation.online_scenario import OnlineScenario

TICKS: Final = 500.0
_LATE: Final = 10e-3
"""s behind its time from which a tick counts as late, because this computer was."""
_MOST_DUE: Final = 250
_LONGEST_QUEUE: Final = 1 << 20
"""Bytes a client may leave unread before it is dropped."""
_GARBLE: Final = b"\x00\x00?robotrue simulated garble"
_CONSTANT: Final[Mapping[str, tuple[str, rtde.Value]]] = {
    "robot_mode": ("INT32", (7,)),
    "safety_mode": ("INT32", (1,)),
    "safety_status": ("INT32", (1,)),
    "runtime_state": ("UINT32", (2,)),
    "robot_status_bits": ("UINT32", (3,)),
    "safety_status_bits": ("UINT32", (1,)),
    "speed_scaling": ("DOUBLE", (1.0,)),
    "target_speed_fraction": ("DOUBLE", (1.0,)),
}
"""Running, in normal mode."""
_MOVING: Final = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "target_q": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "target_TCP_pose": "VECTOR6D",
    "actual_TCP_force": "VECTOR6D",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RtdeControllerSettings:
    """Settings of the simulated RTDE controller.

    Attributes:
        host: Its own address.
        port: TCP; 0 takes a free one.
        started: s its clock shows at the start.
        drift: Part by which its clock runs fast.
        force_noise: N, standard deviation of its estimate of the force.
        seed: Of that noise.
        faults: What goes wrong.
    """

    host: str = LOCAL_HOST
    port: int = RTDE_PORT
    started: float = 100.0
    drift: float = -25e-6
    force_noise: float = 1.0
    seed: int = 0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        """Checks."""
        if not (0.0 <= self.started < 1e9 and abs(self.drift) < 1e-2 and self.force_noise >= 0.0):
            raise ConfigurationError(
                f"clock of {self.started:g} s, drift {self.drift:g}, noise {self.force_noise:g} N; "
                "expected a clock from 0, a drift below a hundredth, no noise below zero."
            )


@dataclass(slots=True, kw_only=True)
class RtdeControllerReport:
    """Counters of a run.

    Attributes:
        sent: Data packets.
        withheld: Data packets a fault kept back for good.
        late: Ticks that came too late, because this computer was.
        answered: Requests.
        refused: Requests that were none, or that it cannot serve.
        clients: Connections taken.
    """

    sent: int = 0
    withheld: int = 0
    late: int = 0
    answered: int = 0
    refused: int = 0
    clients: int = 0


@dataclass(slots=True)
class _Client:
    """One connection, its recipe and its queue."""

    writer: asyncio.StreamWriter
    wire: FaultyWire
    every: int = 1
    recipe: rtde.Recipe | None = None
    started: bool = False


class RtdeController:
    """The controller with its connections; ``port`` is known once it listens."""

    def __init__(self, settings: RtdeControllerSettings, scenario: OnlineScenario) -> None:
        """Opens nothing yet."""
        self.settings = settings
        self.report = RtdeControllerReport()
        self.port: int | None = None
        self.listening = asyncio.Event()
        self._scenario = scenario
        self._noise = np.random.default_rng([settings.seed, 302])
        self._clients: list[_Client] = []
        self._begun = time.monotonic()
        self._tick = 0

    async def run(self, *, stop: asyncio.Event | None = None) -> RtdeControllerReport:
        """Runs until ``stop`` is set or the task is cancelled; returns the report.

        Raises:
            ConfigurationError: The port is taken.
        """
        settings = self.settings
        try:
            server = await asyncio.start_server(self._serve, settings.host, settings.port)
        except OSError as cause:
            raise ConfigurationError(
                f"TCP port {settings.port} of {settings.host} cannot be opened: {cause.strerror}.",
                hint="another port.",
            ) from cause
        self.port = server.sockets[0].getsockname()[1]
        self.listening.set()
        self._begun = time.monotonic()
        try:
            while not (stop is not None and stop.is_set()):
                self._send_due(time.monotonic())
                ahead = self._begun + (self._tick + 1) / TICKS - time.monotonic()
                await asyncio.sleep(max(0.0, ahead))
        finally:
            server.close()
            self._drop_all()
        return self.report

    def _send_due(self, now: float) -> None:
        since = now - self._begun
        due = math.floor(since * TICKS)
        if self._shows(FaultKind.SILENCE, since):
            self._drop_all()
        if due > self._tick:
            first = max(self._tick + 1, due - _MOST_DUE + 1)
            ticks = np.arange(first, due + 1)
            late = int((since - ticks / TICKS > _LATE).sum())
            self.report.late += late
            self._tick = due
            if any(client.started for client in self._clients):
                self._send(ticks, since)

    def _send(self, ticks: IntArray, since: float) -> None:
        columns = self._columns(self._begun + ticks / TICKS, since)
        for client in list(self._clients):
            if client.recipe is None or not client.started:
                continue
            packets = []
            for row in np.flatnonzero(ticks % client.every == 0).tolist():
                values = {
                    name: tuple(columns[name][row].tolist())
                    if name in columns
                    else _CONSTANT[name][1]
                    for name in client.recipe.names
                }
                packets.append(rtde.write_data(client.recipe, values))
            self._deliver(client, packets, since)

    def _columns(self, times: Array, since: float) -> dict[str, Array]:
        """Values that move, (n, 1) or (n, 6) each."""
        scenario, settings = self._scenario, self.settings
        poses = scenario.poses(times)
        turn = rotation_vector_from_matrix(poses[:, :3, :3])
        tool = np.concatenate([poses[:, :3, 3], turn], axis=1)
        joints = scenario.displayed_joints(times)
        noise = settings.force_noise * self._noise.standard_normal((len(times), 6))
        force = scenario.process(times) + noise * np.array([1.0] * 3 + [0.1] * 3)
        if self._shows(FaultKind.NAN, since):
            joints, force = np.full_like(joints, np.nan), np.full_like(force, np.nan)
        clock = settings.started + (times - self._begun) * (1.0 + settings.drift)
        clock += clock_leap(settings.faults, since)
        return {
            "timestamp": clock[:, None],
            "actual_q": joints,
            "target_q": joints,
            "actual_TCP_pose": tool,
            "target_TCP_pose": tool,
            "actual_TCP_force": force,
        }

    def _deliver(self, client: _Client, packets: list[bytes], since: float) -> None:
        """Sends packets as the fault of the moment lets them go."""
        before = client.wire.withheld
        packets = client.wire.transmit(packets, since)
        withheld = self.report.withheld + client.wire.withheld - before
        self.report.withheld = withheld
        transport = client.writer.transport
        if transport.is_closing() or transport.get_write_buffer_size() > _LONGEST_QUEUE:
            self._drop(client)
            return
        client.writer.write(b"".join(packets))
        self.report.sent += len(packets)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._shows(FaultKind.SILENCE, time.monotonic() - self._begun):
            writer.close()
            return
        wire = FaultyWire(self.settings.faults, damage=lambda packet: _GARBLE)
        client = _Client(writer=writer, wire=wire)
        self._clients.append(client)
        self.report.clients += 1
        rest = b""
        try:
            while data := await reader.read(1 << 14):
                frames, rest = rtde.split_frames(rest + data)
                for frame in frames:
                    writer.write(self._answer(client, frame))
                    self.report.answered += 1
        except (FormatError, struct.error, OSError, ValueError):
            self.report.refused += 1
        except asyncio.CancelledError:
            pass  # the simulator ends; nothing else is to be undone here
        finally:
            self._drop(client)

    def _answer(self, client: _Client, frame: rtde.RtdePacket) -> bytes:
        """Returns the controller's reply to a request."""
        if frame.kind == "V":
            wanted = struct.unpack(">H", frame.payload)[0]
            return rtde.write_frame("V", bytes([wanted == rtde.PROTOCOL]))
        if frame.kind == "v":
            return rtde.write_frame("v", struct.pack(">4I", 5, 12, 0, 0))
        if frame.kind == "O":
            rate = struct.unpack(">d", frame.payload[:8])[0]
            recipe = _recipe(frame.payload[8:])
            if recipe.number and 0.0 < rate <= TICKS:
                client.recipe, client.every = recipe, max(1, round(TICKS / rate))
            return rtde.write_recipe("O", recipe)
        if frame.kind == "I":
            return rtde.write_recipe("I", _recipe(frame.payload, nothing=True))
        if frame.kind in "SP":
            client.started = frame.kind == "S" and client.recipe is not None
            return rtde.write_frame(frame.kind, bytes([client.started or frame.kind == "P"]))
        raise FormatError(f"RTDE packet {frame.kind!r} is no request.")

    def _shows(self, kind: FaultKind, since: float) -> bool:
        return showing(self.settings.faults, kind, since)

    def _drop(self, client: _Client) -> None:
        if client in self._clients:
            self._clients.remove(client)
        with contextlib.suppress(RuntimeError):  # the loop may have ended
            client.writer.close()

    def _drop_all(self) -> None:
        for client in list(self._clients):
            self._drop(client)


def _recipe(payload: bytes, *, nothing: bool = False) -> rtde.Recipe:
    """The recipe of names that may end with a comma; number 0 if it has not all of them."""
    names = tuple(name for name in payload.decode("ascii").split(",") if name)
    types = tuple("NOT_FOUND" if nothing else _type(name) for name in names)
    return rtde.Recipe(number=int("NOT_FOUND" not in types), names=names, types=types)


def _type(name: str) -> str:
    return _MOVING.get(name) or _CONSTANT.get(name, ("NOT_FOUND",))[0]
