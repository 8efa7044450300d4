"""A simulated drilling head for practice: it clamps, sends its readings, turns as commanded.

Everything it sends is simulated. It answers for itself what no real machine can: the tilt that is
really left, which it sends as the reference of a hole gauge with its own scatter.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.clamp_watch import SIMULATED
from robotrue.drilling.head import SENSE, normal_from_tilt, rotation, tilt_from_normal
from robotrue.errors import FormatError
from robotrue.online.signals import read_signals, write_signals
from robotrue.simulation.cyclic_controller import Datagrams
from robotrue.simulation.device_defaults import HOLES, SHIFT_UM
from robotrue.simulation.drilling_machine import DrillingMachine, clamp

GAUGE: Final = "hole gauge (simulated)"
SETTLING: Final = 0.08
"""s in which force and readings come to rest."""
_RISE: Final = 0.15
_PATIENCE: Final = 3.0
"""s it waits for an answer before it gives a hole up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillingRun:
    """Settings of the simulated machine.

    Attributes:
        machine: Its truth.
        holes: Number of holes.
        seed: Of surfaces, forces and scatter.
        largest: rad, tilt of the surface against the nominal axes, each of a and b.
        rate: Samples per second.
        gauge_sigma: rad, scatter of the gauge; NaN for no gauge.
        shift_at: Hole from which the first sensor's zero is shifted; 0 for never.
        shift: m.
        damaged: Share of datagrams that are lost, repeated or not finite.
        pause: s between two holes.
        sense: +1 or -1 of A and B: positive sense of the machine against the right-hand rule.
    """

    machine: DrillingMachine
    holes: int = HOLES
    seed: int = 0
    largest: float = 2.0 * DEG
    rate: float = 100.0
    gauge_sigma: float = 5e-3 * DEG
    shift_at: int = 0
    shift: float = SHIFT_UM * UM
    damaged: float = 0.0
    pause: float = 0.0
    sense: tuple[float, float] = SENSE


@dataclass(slots=True)
class DrillingTally:
    """Counters of a run.

    Attributes:
        before: (n, 2) rad, true tilt before each move, of holes that were moved for.
        left: (n, 2) rad, true tilt after it.
        refused: Holes without a move, and why.
        silent: Holes without an answer.
        alarms: Holes at which an alarm came back.
        sent: Datagrams.
    """

    before: list[Array] = field(default_factory=list)
    left: list[Array] = field(default_factory=list)
    refused: list[tuple[str, str]] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    alarms: list[str] = field(default_factory=list)
    sent: int = 0


async def run(
    settings: DrillingRun,
    host: str,
    port: int,
    *,
    stop: asyncio.Event | None = None,
    told: Callable[[str, DrillingTally], None] = lambda hole, tally: None,
) -> DrillingTally:
    """Returns the tally after all holes.

    Args:
        settings: What it does.
        host: Where ``robotrue drill run`` listens.
        port: Likewise.
        stop: Ends it after the hole under way.
        told: Hears the name of every hole once it is done, and the tally so far.
    """
    loop = asyncio.get_running_loop()
    answers: asyncio.Queue[Mapping[str, object]] = asyncio.Queue()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: Datagrams(lambda data: _read_answer(data, answers)), remote_addr=(host, port)
    )
    machine = _Machine(settings, transport, answers)
    try:
        for number in range(1, settings.holes + 1):
            await machine.drill(number)
            told(f"H{number}", machine.tally)
            if stop is not None and (stop.is_set() or await _pause(stop, settings.pause)):
                break
    finally:
        transport.close()
    return machine.tally


async def _pause(stop: asyncio.Event, seconds: float) -> bool:
    """Waits between two holes; returns whether it was stopped meanwhile."""
    try:
        await asyncio.wait_for(stop.wait(), max(seconds, 1e-3))
    except TimeoutError:
        return False
    return True


class _Machine:
    def __init__(
        self,
        settings: DrillingRun,
        transport: asyncio.DatagramTransport,
        answers: asyncio.Queue[Mapping[str, object]],
    ) -> None:
        self._settings, self._transport, self._answers = settings, transport, answers
        self._random = np.random.default_rng(settings.seed)
        self._faults = np.random.default_rng([settings.seed, 1])
        self._axes = np.zeros(2)
        self._sequence = 0
        self.tally = DrillingTally()

    async def drill(self, number: int) -> None:
        """Clamps, turns as commanded, measures with the gauge, and releases."""
        settings, machine, hole = self._settings, self._settings.machine, f"H{number}"
        surface = normal_from_tilt(
            machine.order, self._random.uniform(-settings.largest, settings.largest, 2)
        )
        force = float(self._random.uniform(300.0, 900.0))
        height = float(self._random.uniform(-80.0, 80.0)) * MM
        before = self._tilt(surface)
        readings = clamp(
            machine, before[None], np.array([force]), np.array([height]), self._random
        ).readings[0]
        if settings.shift_at and number >= settings.shift_at:
            readings = readings + np.array([settings.shift, *[0.0] * (len(readings) - 1)])
        answer = await self._send_clamp(hole, readings, force, height)
        if answer is None:
            self.tally.silent.append(hole)
        elif answer.get("status") != "move":
            self.tally.refused.append((hole, str(answer.get("said", ""))))
        else:
            told = np.array([answer["A_deg"], answer["B_deg"]]) * DEG
            self._axes = told * np.asarray(settings.sense)
            left = self._tilt(surface)
            self.tally.before.append(before)
            self.tally.left.append(left)
            await self._send_gauge(hole, left)
        await self._release(hole, readings, height)

    def _tilt(self, surface: Array) -> Array:
        """Returns (2,) rad, the surface normal in the present frame of the spindle."""
        R_machine_spindle = rotation(self._settings.machine.order, self._axes)
        return tilt_from_normal(self._settings.machine.order, R_machine_spindle.T @ surface)

    async def _send_clamp(
        self, hole: str, readings: Array, force: float, height: float
    ) -> Mapping[str, object] | None:
        """Sends the clamp until it is answered."""
        while not self._answers.empty():
            self._answers.get_nowait()
        period = 1.0 / self._settings.rate
        for k in range(round(_PATIENCE / period)):
            since = k * period
            rest = np.exp(-max(0.0, since - _RISE) / SETTLING)
            on = min(1.0, since / _RISE)
            noise = self._random.normal(0.0, self._settings.machine.noise, len(readings))
            self._send(hole, readings + noise + 0.5 * MM * rest, force * on - 30.0 * rest, height)
            try:
                async with asyncio.timeout(period):
                    while True:
                        answer = await self._answers.get()
                        if answer.get("hole") == hole:
                            return answer
            except TimeoutError:
                continue
        return None

    async def _send_gauge(self, hole: str, left: Array) -> None:
        sigma = self._settings.gauge_sigma
        if np.isnan(sigma):
            return
        a, b = ((left + self._random.normal(0.0, sigma, 2)) / DEG).tolist()
        self._put({"hole": hole, "left_a_deg": a, "left_b_deg": b, "truth": GAUGE})
        try:
            async with asyncio.timeout(_PATIENCE):
                while (answer := await self._answers.get()).get("status") == "move":
                    continue
        except TimeoutError:
            return
        if answer.get("status") == "alarm":
            self.tally.alarms.append(hole)

    async def _release(self, hole: str, readings: Array, height: float) -> None:
        for _ in range(3):
            self._send(hole, readings, 0.0, height)
            await asyncio.sleep(1.0 / self._settings.rate)

    def _send(self, hole: str, readings: Array, force: float, height: float) -> None:
        values = {
            **{f"d{k + 1}_mm": v / MM for k, v in enumerate(readings.tolist())},
            "force_N": force,
            "z_mm": height / MM,
            "A_deg": float(self._settings.sense[0] * self._axes[0] / DEG),
            "B_deg": float(self._settings.sense[1] * self._axes[1] / DEG),
            "hole": hole,
        }
        if force > 0.0 and self._faults.random() < self._settings.damaged:
            self._damage(values)
            return
        self._put(values)

    def _damage(self, values: dict[str, object]) -> None:
        """A datagram that is lost, comes twice, has no number for a sensor, or is cut short."""
        kind = int(self._faults.integers(4))
        if kind == 0:
            self._sequence += 1
        elif kind == 1:
            self._put(values)
            self._sequence -= 1
            self._put(values)
        elif kind == 2:
            self._put({**values, "d1_mm": None})
        else:
            self._transport.sendto(write_signals(values)[:-9])

    def _put(self, values: Mapping[str, object]) -> None:
        self._transport.sendto(write_signals({"seq": self._sequence, **values, SIMULATED: 1}))
        self._sequence += 1
        self.tally.sent += 1


def _read_answer(data: bytes, answers: asyncio.Queue[Mapping[str, object]]) -> None:
    """Queues the content of an answer; a datagram that cannot be read is ignored."""
    try:
        sample = read_signals(data, 0.0)
    except FormatError:
        return
    answers.put_nowait({**sample.values, **sample.texts})
