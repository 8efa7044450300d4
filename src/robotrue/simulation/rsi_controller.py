"""A KUKA controller to practise with: it owns the clock, sends ``<Rob>`` and judges each ``<Sen>``.

Simulated throughout. It takes an answer as a controller does: type and IPOC must be right, it must
come before the next packet, what is missing is counted in Delay and HOLDON says what stays, and
after a budget of them RSI breaks off. Corrections move the pose it reports, added up or not.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.rsi_config import RsiConfig
from robotrue.online.samples import CorrectionMode
from robotrue.simulation.foreseen import Foreseen, six
from robotrue.simulation.joint_motion import Motion
from robotrue.simulation.online_faults import Fault, FaultKind
from robotrue.simulation.pace import Pace
from robotrue.simulation.rsi_wire import RobWriter, SenReader
from robotrue.simulation.wire_faults import FaultyWire

_AXES: Final = ("X", "Y", "Z", "A", "B", "C")
_NO_NUMBERS: Final = (math.nan,) * 6


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiControllerSettings:
    """What the simulated controller does.

    Attributes:
        config: Its EthernetConfig.xml; packets go to its host and port.
        mode: What RSI_ON of its program says.
        motion: Where the arm goes.
        cycle_ms: 4 or 12.
        timeout_packets: Answers that may be late or faulty before RSI breaks off.
        limit: m, POSCORR: largest total correction along each axis; more breaks RSI off.
        limit_turn: rad, likewise for the total of each angle.
        first_ipoc: ms, its clock at the start.
        cycles: How many; None goes on to the end of the motion, or until stopped.
        host: Its own address.
        own_port: Its own port; 0 takes a free one.
        faults: What goes wrong, and when.
        keeps_time: A computer too busy for all cycles leaves some out, instead of going slower.
    """

    config: RsiConfig
    mode: CorrectionMode
    motion: Motion
    cycle_ms: int = 4
    timeout_packets: int = 100
    limit: float = 5.0 * MM
    limit_turn: float = 5.0 * DEG
    first_ipoc: int = 4_208_163_634
    cycles: int | None = None
    host: str = "127.0.0.1"
    own_port: int = 0
    faults: tuple[Fault, ...] = ()
    keeps_time: bool = False

    def __post_init__(self) -> None:
        """Checks."""
        if self.cycle_ms not in (4, 12) or self.timeout_packets < 0:
            raise ConfigurationError(
                f"cycle of {self.cycle_ms} ms, budget of {self.timeout_packets}; expected 4 or 12 "
                "ms and a budget from 0."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiControllerReport:
    """What came of it.

    Attributes:
        cycles: Of its clock.
        answered: Answers taken.
        late: Cycles without an answer in time, from the first answer on.
        overslept: Of these, cycles that the simulator cut short, because this computer had slept
            over the end of one before: nobody who answers is to blame for them.
        left_out: Cycles without a packet, because this computer was too busy for them.
        faulty: Answers of another type or IPOC, or that cannot be read.
        broke_off: Why RSI broke off; empty if it did not.
        correction: (6,) total at the end, mm and deg.
        largest_mm: Largest total shift.
        largest_step_mm: Largest change of it from one cycle to the next.
    """

    cycles: int = 0
    answered: int = 0
    late: int = 0
    overslept: int = 0
    left_out: int = 0
    faulty: int = 0
    broke_off: str = ""
    correction: Array = field(default_factory=lambda: np.zeros(6))
    largest_mm: float = 0.0
    largest_step_mm: float = 0.0


async def run(
    settings: RsiControllerSettings, *, stop: asyncio.Event | None = None
) -> RsiControllerReport:
    """Returns the report after the last cycle, when RSI broke off, or when stopped.

    Args:
        settings: What it does.
        stop: Set to end it after the cycle that runs.
    """
    controller = RsiController(settings)
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: _Answers(controller), local_addr=(settings.host, settings.own_port)
    )
    target = (settings.config.host, settings.config.port)
    pace = Pace(settings.cycle_ms * 1e-3)
    try:
        while not (stop is not None and stop.is_set()):
            packet = controller.next_packet()
            if packet is None:
                break
            for datagram in controller.wire.passed(packet, controller.elapsed):
                transport.sendto(datagram, target)
            short = await pace.wait()
            controller.close_cycle(short=short)
            if settings.keeps_time:
                controller.leave_out(pace.left_out())
    finally:
        transport.close()
    return controller.report


class RsiController:
    """The controller without its socket: one packet, its answers, the end of the cycle."""

    def __init__(self, settings: RsiControllerSettings) -> None:
        self.settings = settings
        self.report = RsiControllerReport()
        self.wire = FaultyWire(settings.faults)
        self.elapsed = 0.0
        self._foreseen = Foreseen(settings.motion, settings.cycle_ms * 1e-3)
        self._writer, self._reader = RobWriter(self._further()), SenReader(settings.config)
        self._ipoc = settings.first_ipoc
        self._answer: Mapping[str, float] | None = None
        self._total = [0.0] * 6
        self._most = [settings.limit / MM] * 3 + [settings.limit_turn / DEG] * 3
        self._faulty = False
        self._attached = False
        self._forgiven = self._excused = 0
        self._held = dict.fromkeys(_AXES, 0.0)

    def next_packet(self) -> bytes | None:
        """Returns the packet of the cycle that begins; None when there is no more to send."""
        made = self.report.cycles
        end = self.settings.cycles
        if self.report.broke_off or (end is not None and made >= end):
            return None
        elapsed = made * self.settings.cycle_ms * 1e-3
        if elapsed > self.settings.motion.duration:
            return None
        self.elapsed = elapsed
        if self.wire.over(FaultKind.SILENCE, elapsed, self.settings.cycle_ms * 1e-3):
            self._begin_anew()
        clock = made * self.settings.cycle_ms + round(1e3 * self.wire.leapt(elapsed))
        self._ipoc = self.settings.first_ipoc + clock
        self._answer, self._faulty = None, False
        place = self._foreseen.at(made)
        joints, pose = place.joints_deg, place.pose_mm_deg
        if self.wire.shows(FaultKind.NAN, elapsed):
            joints = _NO_NUMBERS
        if pose is not None:
            pose = six([a + b for a, b in zip(pose, self._total, strict=True)])
        self.report = replace(self.report, cycles=made + 1)
        return self._writer.write(self._ipoc, self._delay(), joints, pose)

    def leave_out(self, cycles: int) -> None:
        """Lets cycles pass without a packet."""
        report = self.report
        self.report = replace(
            report, cycles=report.cycles + cycles, left_out=report.left_out + cycles
        )

    def take(self, data: bytes) -> None:
        """Takes a datagram that came during the cycle."""
        if self.settings.config.only_send or self._silent:
            return
        try:
            answer = self._reader.read(data, self._ipoc)
        except FormatError:
            if self._is_late(data):
                return
            self._faulty = True
            return
        if self._answer is not None:
            self._faulty = True
            return
        self._answer = answer

    def close_cycle(self, *, short: bool = False) -> None:
        """Judges the cycle and moves by what was answered, or by what HOLDON says.

        Args:
            short: Whether the simulator gave it less time than a controller would.
        """
        if self.settings.config.only_send or self._silent:
            return
        report = self.report
        if self._answer is not None:
            self._attached = True
            report = replace(report, answered=report.answered + 1)
        elif self._attached and not self._faulty:
            late, overslept = report.late + 1, report.overslept + short
            report = replace(report, late=late, overslept=overslept)
        if self._faulty:
            report = replace(report, faulty=report.faulty + 1)
        if self._attached:
            report = self._moved(report)
        if self._counted(report) > self.settings.timeout_packets:
            report = replace(
                report,
                broke_off=f"{report.late - report.overslept} late and {report.faulty} faulty "
                "answers in cycles that had their time, more than "
                f"{self.settings.timeout_packets}",
            )
        self.report = report

    def _counted(self, report: RsiControllerReport) -> int:
        """Late and faulty answers since RSI_ON, of cycles that had their time."""
        return report.late - report.overslept + report.faulty - self._forgiven

    def _delay(self) -> int:
        """What Delay says: where answers are added up, those that were cut short count, too."""
        relative = self.settings.mode is CorrectionMode.RELATIVE
        return self._counted(self.report) + relative * (self.report.overslept - self._excused)

    @property
    def _silent(self) -> bool:
        return self.wire.shows(FaultKind.SILENCE, self.elapsed)

    def _begin_anew(self) -> None:
        """RSI_ON once more: no correction is held, and late answers are counted from zero."""
        self._attached = False
        self._held = dict.fromkeys(_AXES, 0.0)
        self._forgiven += self._counted(self.report)
        self._excused = self.report.overslept
        self._total = [0.0] * 6
        self.report = replace(self.report, correction=np.zeros(6))

    def _moved(self, report: RsiControllerReport) -> RsiControllerReport:
        given = []
        for axis in _AXES:
            element = self.settings.config.receives(f"RKorr.{axis}")
            if self._answer is not None:
                self._held[axis] = self._answer.get(f"RKorr.{axis}", 0.0)
            elif element is None or not element.hold:
                self._held[axis] = 0.0
            given.append(0.0 if element is None else self._held[axis])
        before, total = self._total, given
        if self.settings.mode is CorrectionMode.RELATIVE:
            total = [a + b for a, b in zip(before, given, strict=True)]
        if total == before:
            return report
        self._total = total
        report = replace(
            report,
            correction=np.array(total),
            largest_mm=max(report.largest_mm, math.hypot(*total[:3])),
            largest_step_mm=max(report.largest_step_mm, math.dist(total[:3], before[:3])),
        )
        for axis, value, most in zip(_AXES, total, self._most, strict=True):
            if not abs(value) <= most:
                return replace(
                    report, broke_off=f"correction {axis} of {value:.6f} is beyond {most:g}"
                )
        return report

    def _further(self) -> dict[str, float]:
        """What else the configuration says is sent, at zero: the other side may insist on it."""
        sent = {"RIst", "AIPos", "Delay", "IPOC"}
        return {
            element.tag: 0.0
            for element in self.settings.config.send
            if element.kind != "STRING" and element.tag not in sent
        }

    def _is_late(self, data: bytes) -> bool:
        """Whether it answers an earlier packet: its cycle has been counted then."""
        step = self.settings.cycle_ms
        for back in range(1, min(self.report.cycles, 2 * self.settings.timeout_packets + 2)):
            if b"<IPOC>%d</IPOC>" % (self._ipoc - back * step) in data:
                return True
        return False


class _Answers(asyncio.DatagramProtocol):
    def __init__(self, controller: RsiController) -> None:
        self._controller = controller

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._controller.take(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens yet: the cycle stays without an answer."""
