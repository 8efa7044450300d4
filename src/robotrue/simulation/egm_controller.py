"""An ABB controller to practise with: ``EgmRobot`` every 4 ms, path corrections taken and judged.

Simulated throughout: the motion, the force and how the robot follows. A path correction is taken
as the offset from the programmed path that is to be held from then on.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
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
from robotrue.simulation.joint_motion import Motion
from robotrue.simulation.online_faults import Fault, FaultKind
from robotrue.simulation.pace import Pace
from robotrue.simulation.wire_faults import FaultyWire

_CYCLE: Final = 4e-3
_REST: Final = 10
"""Messages of a guidance that is stopped, before it begins anew."""
_OLDEST: Final = 1000
"""ms; an older measurement is no correction."""


def milling_force(time: float) -> tuple[float, ...]:
    """Returns Fx Fy Fz N, Tx Ty Tz N m of a simulated cut: a mean and a line at 60 Hz."""
    tooth = math.sin(2.0 * math.pi * 60.0 * time)
    return (-30.0 - 12.0 * tooth, -5.0 + 40.0 * tooth, 8.0 + 3.0 * tooth, 0.4, -2.0, 0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmControllerSettings:
    """What the simulated controller does.

    Attributes:
        target: Address and port of the computer that listens, as UCDevice names them.
        generation: Which egm.proto it speaks.
        motion: Where the arm goes.
        force: Measured force at a time, s; None sends none.
        force_active: RobotWare 7: whether force control is on.
        lag: s, time constant with which a correction is followed.
        limit: m, largest offset along each axis it takes; a larger one stops the guidance.
        silence: s without a message after which the guidance stops with an error, once one came.
        cycles: How many; None goes on to the end of the motion, or until stopped.
        host: Its own address.
        own_port: Its own port; 0 takes a free one.
        faults: What goes wrong, and when.
        keeps_time: A computer too busy for all cycles leaves some out, instead of going slower.
    """

    target: tuple[str, int]
    generation: RobotWare
    motion: Motion
    force: Callable[[float], tuple[float, ...]] | None = None
    force_active: bool = True
    lag: float = 0.02
    limit: float = 5.0 * MM
    silence: float = 1.0
    cycles: int | None = None
    host: str = "127.0.0.1"
    own_port: int = 0
    faults: tuple[Fault, ...] = ()
    keeps_time: bool = False

    def __post_init__(self) -> None:
        """Checks."""
        if not (self.lag >= 0.0 and self.limit > 0.0 and self.silence > 0.0):
            raise ConfigurationError(
                f"lag {self.lag:g} s, limit {self.limit / MM:g} mm, silence {self.silence:g} s; "
                "expected none below zero, and a limit and a silence."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmControllerReport:
    """What came of it.

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


async def run(
    settings: EgmControllerSettings, *, stop: asyncio.Event | None = None
) -> EgmControllerReport:
    """Returns the report after the last cycle, or when stopped.

    Args:
        settings: What it does.
        stop: Set to end it after the cycle that runs.
    """
    controller = EgmController(settings)
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: _Messages(controller), local_addr=(settings.host, settings.own_port)
    )
    pace = Pace(_CYCLE)
    try:
        while not (stop is not None and stop.is_set()):
            message = controller.next_message()
            if message is None:
                break
            for datagram in controller.wire.passed(message, controller.elapsed):
                transport.sendto(datagram, settings.target)
            await pace.wait()
            if settings.keeps_time:
                controller.leave_out(pace.left_out())
    finally:
        transport.close()
    return controller.report


class EgmController:
    """The controller without its socket."""

    def __init__(self, settings: EgmControllerSettings) -> None:
        self.settings = settings
        self.report = EgmControllerReport()
        self.wire = FaultyWire(settings.faults)
        self.elapsed = 0.0
        self._wanted = np.zeros(3)
        self._heard: int | None = None
        self._resting = 0

    def next_message(self) -> bytes | None:
        """Returns the message of the cycle that begins; None when there is no more to send."""
        settings, made = self.settings, self.report.cycles
        elapsed = made * _CYCLE
        over = settings.cycles is not None and made >= settings.cycles
        if over or elapsed > settings.motion.duration:
            return None
        self.elapsed = elapsed
        if self.wire.over(FaultKind.SILENCE, elapsed, _CYCLE):
            self._begin_anew()
        self._follow(made)
        joints, T_base_tool = settings.motion.at(elapsed)
        shown = tuple((joints / DEG).tolist())
        force = () if settings.force is None else settings.force(elapsed)
        if self.wire.shows(FaultKind.NAN, elapsed):
            shown, force = (math.nan,) * len(shown), (math.nan,) * len(force)
        leapt = self.wire.leapt(elapsed)
        robot = EgmRobot(
            seqno=made + round(leapt / _CYCLE),
            tm_ms=round((elapsed + leapt) * 1e3),
            joints_deg=shown,
            pose=self._pose(T_base_tool),
            planned_deg=shown,
            clock=(made // 250 + round(leapt), made % 250 * 4000),
            motors=MotorState.ON,
            guidance=self._guidance(),
            converged=False,
            rapid=RapidState.RUNNING,
            force_sent=settings.force is not None,
            force_active=settings.force_active if settings.generation is RobotWare.SEVEN else None,
            force=force,
        )
        self.report = replace(self.report, cycles=made + 1)
        return write_robot(robot, settings.generation)

    def leave_out(self, cycles: int) -> None:
        """Lets cycles pass without a message."""
        report = self.report
        self.report = replace(
            report, cycles=report.cycles + cycles, left_out=report.left_out + cycles
        )

    def take(self, data: bytes) -> None:
        """Takes a datagram of the computer."""
        report = self.report
        try:
            _, xyz_mm, age_ms = read_path_correction(data)
        except FormatError:
            self.report = _with_target(report, data)
            self._heard = report.cycles
            return
        wanted = np.array(xyz_mm) * MM
        if not np.isfinite(wanted).all() or age_ms > _OLDEST:
            self.report = replace(report, faulty=report.faulty + 1)
        elif np.abs(wanted).max() > self.settings.limit:
            self._stop(f"offset {wanted / MM} mm is beyond {self.settings.limit / MM:g} mm")
        elif not self._resting:
            self._wanted, self._heard = wanted, report.cycles
            self.report = replace(report, corrections=report.corrections + 1)

    def _guidance(self) -> GuidanceState:
        self._resting -= self._resting > 0
        if self.report.stopped:
            return GuidanceState.ERROR
        return GuidanceState.STOPPED if self._resting else GuidanceState.RUNNING

    def _begin_anew(self) -> None:
        """EGMRunMove once more: it begins on the programmed path."""
        self._resting, self._heard = _REST + 1, None
        self._wanted = np.zeros(3)
        self.report = replace(self.report, offset=np.zeros(3))

    def _follow(self, made: int) -> None:
        if self._heard is not None and (made - self._heard) * _CYCLE > self.settings.silence:
            self._stop(f"no message for {self.settings.silence:g} s")
        if self.report.stopped:
            return
        part = 1.0 if self.settings.lag == 0.0 else -math.expm1(-_CYCLE / self.settings.lag)
        offset = self.report.offset + part * (self._wanted - self.report.offset)
        largest = max(self.report.largest_mm, float(np.linalg.norm(offset)) / MM)
        self.report = replace(self.report, offset=offset, largest_mm=largest)

    def _stop(self, why: str) -> None:
        if not self.report.stopped:
            self.report = replace(self.report, stopped=why)

    def _pose(self, T_base_tool: Array) -> EgmPose | None:
        if np.isnan(T_base_tool).any():
            return None
        xyz = (T_base_tool[:3, 3] + self.report.offset) / MM
        quat = quat_wxyz_from_matrix(T_base_tool[:3, :3])
        return EgmPose(xyz_mm=tuple(xyz.tolist()), quat_wxyz=tuple(quat.tolist()))


def _with_target(report: EgmControllerReport, data: bytes) -> EgmControllerReport:
    try:
        read_target(data)
    except FormatError:
        return replace(report, faulty=report.faulty + 1)
    return replace(report, targets=report.targets + 1)


class _Messages(asyncio.DatagramProtocol):
    def __init__(self, controller: EgmController) -> None:
        self._controller = controller

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._controller.take(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens yet."""
