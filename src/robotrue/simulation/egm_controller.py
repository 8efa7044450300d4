"""An ABB controller to practise with: ``EgmRobot`` every 4 ms, path corrections taken and checked.

Simulated throughout: the motion, the force and how the robot follows. A path correction is taken
as the offset from the programmed path that is to be held from then on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.egm import (
    EgmPose,
    EgmRobot,
    GuidanceState,
    MotorState,
    RapidState,
    RobotWare,
    read_path_correction,
    read_target,
    write_robot,
)
from robotrue.simulation.cyclic_controller import CyclicController, CyclicSettings, Place
from robotrue.simulation.device_defaults import MOST_MM
from robotrue.simulation.online_faults import FaultKind, clock_leap

_CYCLE: Final = 4e-3
_REST: Final = 10
"""Messages of a stopped guidance before it restarts."""
_OLDEST: Final = 1000
"""ms; an older measurement is no correction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmControllerSettings(CyclicSettings):
    """Settings of the simulated EGM controller beyond those of every controller.

    Attributes:
        target: Address and port of the computer that listens, as UCDevice names them.
        generation: Version of its egm.proto.
        force: Measured force at a time, s; None sends none.
        force_active: RobotWare 7: whether force control is on.
        lag: s, time constant with which a correction is followed.
        limit: m, largest offset along each axis it takes; a larger one stops the guidance.
        silence: s without a message after which the guidance stops with an error, once one came.
    """

    target: tuple[str, int]
    generation: RobotWare
    force: Callable[[float], tuple[float, ...]] | None = None
    force_active: bool = True
    lag: float = 0.02
    limit: float = MOST_MM * MM
    silence: float = 1.0

    def __post_init__(self) -> None:
        """Checks."""
        if not (self.lag >= 0.0 and self.limit > 0.0 and self.silence > 0.0):
            raise ConfigurationError(
                f"lag {self.lag:g} s, limit {self.limit / MM:g} mm, silence {self.silence:g} s; "
                "expected none below zero, and a limit and a silence."
            )


@dataclass(slots=True, kw_only=True)
class EgmControllerReport:
    """Counters of a run.

    Attributes:
        cycles: Of its clock.
        left_out: Cycles without a message, because this computer was too busy for them.
        corrections: Path corrections taken.
        targets: Joint or pose targets that came; read, counted, not followed.
        faulty: Messages that could not be read or taken.
        stopped: Why the guidance stopped with an error; empty if it did not.
        offset: (3,) m that the robot is off its programmed path at the end.
        largest_mm: Largest offset on the way.
    """

    cycles: int = 0
    left_out: int = 0
    corrections: int = 0
    targets: int = 0
    faulty: int = 0
    stopped: str = ""
    offset: Array = field(default_factory=lambda: np.zeros(3))
    largest_mm: float = 0.0


class EgmController(CyclicController[EgmControllerReport]):
    """The controller cycle by cycle.

    Args:
        settings: What it does.
    """

    def __init__(self, settings: EgmControllerSettings) -> None:
        super().__init__(settings, _CYCLE, settings.target)
        self.settings = settings
        self._report = EgmControllerReport()
        self._wanted = np.zeros(3)
        self._heard: int | None = None
        self._resting = 0

    @property
    def report(self) -> EgmControllerReport:
        """Returns the report so far."""
        return replace(self._report, cycles=self.cycles, left_out=self.left_out)

    def _packet(self, number: int) -> bytes:
        settings, elapsed = self.settings, self.elapsed
        self._follow(number)
        place = self._grid.at(number)
        shown: tuple[float, ...] = place.joints_deg
        force = () if settings.force is None else settings.force(elapsed)
        if self._shows(FaultKind.NAN):
            shown, force = (math.nan,) * len(shown), (math.nan,) * len(force)
        leap = clock_leap(settings.faults, elapsed)
        robot = EgmRobot(
            seqno=number + round(leap / _CYCLE),
            tm_ms=round((elapsed + leap) * 1e3),
            joints_deg=shown,
            pose=self._pose(place),
            planned_deg=shown,
            clock=(number // 250 + round(leap), number % 250 * 4000),
            motors=MotorState.ON,
            guidance=self._guidance(),
            converged=False,
            rapid=RapidState.RUNNING,
            force_sent=settings.force is not None,
            force_active=settings.force_active if settings.generation is RobotWare.SEVEN else None,
            force=force,
        )
        return write_robot(robot, settings.generation)

    def take(self, data: bytes) -> None:
        """Processes a datagram of the computer."""
        report = self._report
        try:
            _, xyz_mm, age_ms = read_path_correction(data)
        except FormatError:
            if _is_target(data):
                report.targets += 1
            else:
                report.faulty += 1
            self._heard = self.cycles
            return
        wanted = np.array(xyz_mm) * MM
        if not np.isfinite(wanted).all() or age_ms > _OLDEST:
            report.faulty += 1
        elif np.abs(wanted).max() > self.settings.limit:
            self._stop(f"offset {wanted / MM} mm is beyond {self.settings.limit / MM:g} mm")
        elif not self._resting:
            self._wanted, self._heard = wanted, self.cycles
            report.corrections += 1

    def _guidance(self) -> GuidanceState:
        self._resting -= self._resting > 0
        if self._report.stopped:
            return GuidanceState.ERROR
        return GuidanceState.STOPPED if self._resting else GuidanceState.RUNNING

    def _restart(self) -> None:
        """EGMRunMove once more: it begins on the programmed path."""
        self._resting, self._heard = _REST + 1, None
        self._wanted = np.zeros(3)
        self._report.offset = np.zeros(3)

    def _follow(self, made: int) -> None:
        if self._heard is not None and (made - self._heard) * _CYCLE > self.settings.silence:
            self._stop(f"no message for {self.settings.silence:g} s")
        report = self._report
        if report.stopped:
            return
        part = 1.0 if self.settings.lag == 0.0 else -math.expm1(-_CYCLE / self.settings.lag)
        report.offset = report.offset + part * (self._wanted - report.offset)
        report.largest_mm = max(report.largest_mm, float(np.linalg.norm(report.offset)) / MM)

    def _stop(self, why: str) -> None:
        self._report.stopped = self._report.stopped or why

    def _pose(self, place: Place) -> EgmPose | None:
        if place.pose_mm_deg is None:
            return None
        xyz = np.array(place.pose_mm_deg[:3]) + self._report.offset / MM
        return EgmPose(xyz_mm=tuple(xyz.tolist()), quat_wxyz=place.quat_wxyz)


def _is_target(data: bytes) -> bool:
    try:
        read_target(data)
    except FormatError:
        return False
    return True
