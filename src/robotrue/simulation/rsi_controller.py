"""A KUKA controller to practise with: it owns the clock, sends ``<Rob>`` and checks each ``<Sen>``.

Simulated throughout. It accepts an answer as a controller does: type and IPOC must be right, it
must come before the next packet, missing answers are counted in Delay and HOLDON sets whether the
last one holds, and after a budget of them RSI breaks off. Corrections move the pose it reports,
added up or not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.device_defaults import RSI_CYCLE_MS
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.rsi import RobPacket
from robotrue.online.rsi_answer import read_sen, write_rob
from robotrue.online.rsi_config import RsiConfig
from robotrue.simulation.cyclic_controller import CyclicController, CyclicSettings, six
from robotrue.simulation.device_defaults import MOST_MM
from robotrue.simulation.online_faults import FaultKind, clock_leap

_AXES: Final = ("X", "Y", "Z", "A", "B", "C")
_NO_NUMBERS: Final = (math.nan,) * 6


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiControllerSettings(CyclicSettings):
    """Settings of the simulated RSI controller beyond those of every controller.

    Attributes:
        config: Its EthernetConfig.xml; packets go to its host and port.
        mode: Mode of RSI_ON in its program.
        cycle_ms: 4 or 12.
        timeout_packets: Answers that may be late or faulty before RSI breaks off.
        limit: m, POSCORR: largest total correction along each axis; more breaks RSI off.
        limit_turn: rad, likewise for the total of each angle.
        first_ipoc: ms, its clock at the start.
    """

    config: RsiConfig
    mode: CorrectionMode
    cycle_ms: int = RSI_CYCLE_MS
    timeout_packets: int = 100
    limit: float = MOST_MM * MM
    limit_turn: float = 5.0 * DEG
    first_ipoc: int = 4_208_163_634

    @property
    def cycle(self) -> float:
        """Length of a cycle, s."""
        return self.cycle_ms * 1e-3

    def __post_init__(self) -> None:
        """Checks."""
        if self.cycle_ms not in (4, 12) or self.timeout_packets < 0:
            raise ConfigurationError(
                f"cycle of {self.cycle_ms} ms, budget of {self.timeout_packets}; expected 4 or 12 "
                "ms and a budget from 0."
            )


@dataclass(slots=True, kw_only=True)
class RsiControllerReport:
    """Counters of a run.

    Attributes:
        cycles: Of its clock.
        answered: Answers taken.
        late: Cycles without an answer in time, from the first answer on.
        overslept: Of these, cycles that the simulator cut short, because this computer had
            overslept the end of one before: not a fault of the answering side.
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


class RsiController(CyclicController[RsiControllerReport]):
    """The controller cycle by cycle.

    Args:
        settings: What it does.
    """

    def __init__(self, settings: RsiControllerSettings) -> None:
        target = (settings.config.host, settings.config.port)
        super().__init__(settings, settings.cycle, target)
        self.settings = settings
        self._report = RsiControllerReport()
        self._signals = self._extra_signals()
        self._ipoc = settings.first_ipoc
        self._answer: Mapping[str, float] | None = None
        self._total = [0.0] * 6
        self._most = [settings.limit / MM] * 3 + [settings.limit_turn / DEG] * 3
        self._faulty = False
        self._attached = False
        self._forgiven = self._excused = 0
        self._held = dict.fromkeys(_AXES, 0.0)

    @property
    def report(self) -> RsiControllerReport:
        """Returns the report so far."""
        return replace(self._report, cycles=self.cycles, left_out=self.left_out)

    def _packet(self, number: int) -> bytes:
        leap = clock_leap(self.settings.faults, self.elapsed)
        clock = number * self.settings.cycle_ms + round(1e3 * leap)
        self._ipoc = self.settings.first_ipoc + clock
        self._answer, self._faulty = None, False
        place = self._grid.at(number)
        joints, pose = place.joints_deg, place.pose_mm_deg
        if self._shows(FaultKind.NAN):
            joints = _NO_NUMBERS
        if pose is not None:
            pose = six([a + b for a, b in zip(pose, self._total, strict=True)])
        return write_rob(
            RobPacket(
                ipoc=self._ipoc,
                late=self._delay_value(),
                joints_deg=joints,
                pose_mm_deg=pose,
                signals=self._signals,
            )
        )

    def _is_over(self) -> bool:
        return bool(self._report.broke_off)

    def take(self, data: bytes) -> None:
        """Processes an answer, valid or not."""
        if self.settings.config.only_send or self._shows(FaultKind.SILENCE):
            return
        try:
            answer = read_sen(data, self.settings.config, self._ipoc)
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
        """Counts the answer of the cycle and moves by it, or as set by HOLDON.

        Args:
            short: Whether the simulator gave it less time than a controller would.
        """
        if self.settings.config.only_send or self._shows(FaultKind.SILENCE):
            return
        report = self._report
        if self._answer is not None:
            self._attached = True
            report.answered += 1
        elif self._attached and not self._faulty:
            report.late += 1
            report.overslept += short
        report.faulty += self._faulty
        if self._attached:
            self._apply_answer(report)
        if self._count_faults() > self.settings.timeout_packets:
            report.broke_off = (
                f"{report.late - report.overslept} late and {report.faulty} faulty answers in "
                f"cycles that had their time, more than {self.settings.timeout_packets}"
            )

    def _count_faults(self) -> int:
        """Late and faulty answers since RSI_ON, of cycles that had their time."""
        report = self._report
        return report.late - report.overslept + report.faulty - self._forgiven

    def _delay_value(self) -> int:
        """Returns the value of Delay; in relative mode it includes truncated answers."""
        relative = self.settings.mode is CorrectionMode.RELATIVE
        return self._count_faults() + relative * (self._report.overslept - self._excused)

    def _restart(self) -> None:
        """RSI_ON once more: no correction is held, and late answers are counted from zero."""
        self._attached = False
        self._held = dict.fromkeys(_AXES, 0.0)
        self._forgiven += self._count_faults()
        self._excused = self._report.overslept
        self._total = [0.0] * 6
        self._report.correction = np.zeros(6)

    def _apply_answer(self, report: RsiControllerReport) -> None:
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
            return
        self._total = total
        report.correction = np.array(total)
        report.largest_mm = max(report.largest_mm, math.hypot(*total[:3]))
        report.largest_step_mm = max(report.largest_step_mm, math.dist(total[:3], before[:3]))
        for axis, value, most in zip(_AXES, total, self._most, strict=True):
            if not abs(value) <= most:
                report.broke_off = f"correction {axis} of {value:.6f} is beyond {most:g}"
                return

    def _extra_signals(self) -> dict[str, float]:
        """Returns the other configured signals, at zero: the other side may require them."""
        sent = {"RIst", "AIPos", "Delay", "IPOC"}
        return {
            element.tag: 0.0
            for element in self.settings.config.send
            if element.kind != "STRING" and element.tag not in sent
        }

    def _is_late(self, data: bytes) -> bool:
        """True if the answer is to an earlier packet, whose cycle was counted already."""
        step = self.settings.cycle_ms
        for back in range(1, min(self.cycles, 2 * self.settings.timeout_packets + 2)):
            if b"<IPOC>%d</IPOC>" % (self._ipoc - back * step) in data:
                return True
        return False
