"""Base of simulated controllers with their own clock: motion, cycles, faults, UDP.

Where the arm goes depends on time alone, and arrays of one element cost as much as arrays of sixty:
the places of many cycles are computed at once.
"""

from __future__ import annotations

import asyncio
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Generic, Protocol, TypeVar

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.rotations import abc_from_matrix, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.simulation.device_defaults import LOCAL_HOST
from robotrue.simulation.online_faults import Fault, FaultKind, FaultyWire, showing


class ArmMotion(Protocol):
    """Motion of the arm over time."""

    @property
    def duration(self) -> float:
        """s; infinite for a motion that repeats."""

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints (n, dof) rad as displayed and T_base_tool (n, 4, 4) m.

        Args:
            times: (n,) s from the begin of the motion.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Jog(Columns):
    """One joint to and fro: what clocks are aligned with.

    Attributes:
        robot: The arm.
        joints: (dof,) rad, model joints where it starts.
        axis: Which joint, from 1.
        amplitude: rad to the far end.
        period: s to the far end and back.
    """

    robot: RobotModel
    joints: Annotated[Array, Column("dof", unit="rad")]
    axis: int = 1
    amplitude: float = math.radians(5.0)
    period: float = 4.0

    def __post_init__(self) -> None:
        """Checks the values."""
        self._check_columns(dof=self.robot.dof)
        if not 1 <= self.axis <= self.robot.dof or not self.period > 0.0:
            raise ConfigurationError(
                f"jog of axis {self.axis} in {self.period:g} s, expected an axis from 1 to "
                f"{self.robot.dof} and more than 0 s."
            )

    @property
    def duration(self) -> float:
        """Infinite: it repeats."""
        return math.inf

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints and poses; smooth, at rest at both ends."""
        joints = np.repeat(self.joints[None], len(times), axis=0)
        turn = 0.5 * (1.0 - np.cos(2.0 * math.pi * times / self.period))
        joints[:, self.axis - 1] += self.amplitude * turn
        return controller_axes(self.robot, joints), forward(self.robot, joints)


_AHEAD: Final = 64
"""Cycles: half a millisecond of work four times a second."""
Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Place:
    """Pose of the arm in one cycle, in the units of controllers.

    Attributes:
        joints_deg: As displayed.
        pose_mm_deg: X, Y, Z, A, B, C of the tool in base; None where it is not known.
        quat_wxyz: Attitude of the tool in base; that of no turn where it is not known.
    """

    joints_deg: Six
    pose_mm_deg: Six | None
    quat_wxyz: tuple[float, ...]


def six(numbers: list[float]) -> Six:
    """Returns a list of six as a tuple."""
    a, b, c, d, e, f = numbers
    return a, b, c, d, e, f


class MotionGrid:
    """The places of a motion on the grid of a controller's cycles.

    Args:
        motion: Of an arm of six joints.
        cycle: s.
    """

    def __init__(self, motion: ArmMotion, cycle: float) -> None:
        self._motion, self._cycle = motion, cycle
        self._first, self._places = 0, list[Place]()

    def at(self, number: int) -> Place:
        """Returns the place at a cycle, counted from zero."""
        row = number - self._first
        if not 0 <= row < len(self._places):
            self._first, row = number, 0
            times = np.arange(number, number + _AHEAD, dtype=np.float64) * self._cycle
            self._places = _places(self._motion, times)
        return self._places[row]


def _places(motion: ArmMotion, times: Array) -> list[Place]:
    joints, poses = motion.along(times)
    known: BoolArray = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    turns = np.where(known[:, None, None], poses, np.eye(4))[:, :3, :3]
    printed = np.concatenate([poses[:, :3, 3] / MM, abc_from_matrix(turns) / DEG], axis=1)
    columns = (joints / DEG, printed, quat_wxyz_from_matrix(turns), known)
    return [
        Place(six(a), six(b) if there else None, tuple(q))
        for a, b, q, there in zip(*(column.tolist() for column in columns), strict=True)
    ]


R = TypeVar("R")
_WHOLE: Final = 0.9
"""Of a cycle; a shorter one gives less time for an answer than a controller would."""
_SHORTEST: Final = 0.5
"""Of a cycle; what a computer that slept makes up for, cycle by cycle."""
_BEHIND: Final = 5
"""Cycles that are made up for so; cycles with a larger delay are left out where time is kept."""


class Pace:
    """Cycles of an event loop.

    Args:
        cycle: s.
    """

    def __init__(self, cycle: float) -> None:
        self._cycle = cycle
        self._due = asyncio.get_running_loop().time()

    async def wait(self) -> bool:
        """Waits for the end of the cycle that runs; call it right after its packet was sent.

        Returns whether it was shorter than a controller's, to make up for one that was overslept.

        Delayed cycles are compensated by shorter ones. A controller never sends two packets at
        once, and a computer that plays one must not, either: the answer to the first would be late
        through no fault of its sender.
        """
        now = asyncio.get_running_loop().time()
        self._due += self._cycle
        room = self._due - now
        await asyncio.sleep(max(room, _SHORTEST * self._cycle))
        return asyncio.get_running_loop().time() - now < _WHOLE * self._cycle

    def skip_overdue(self) -> int:
        """Skips cycles with too large a delay and returns their number.

        A controller's clock does not go slower because a computer is busy; one that plays it sends
        fewer packets instead, as if they had been lost on their way.
        """
        behind = int((asyncio.get_running_loop().time() - self._due) / self._cycle)
        if behind <= _BEHIND:
            return 0
        self._due += behind * self._cycle
        return behind


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclicSettings:
    """Settings of every cyclic controller.

    Attributes:
        motion: Motion of the arm.
        cycles: Number of cycles; None runs to the end of the motion, or until stopped.
        host: Its own address.
        own_port: Its own port; 0 takes a free one.
        faults: Faults and their times.
        keeps_time: Whether a computer too busy for all cycles leaves some out, instead of running
            slower.
    """

    motion: ArmMotion
    cycles: int | None = None
    host: str = LOCAL_HOST
    own_port: int = 0
    faults: tuple[Fault, ...] = ()
    keeps_time: bool = False


class CyclicController(ABC, Generic[R]):
    """A controller cycle by cycle: one packet, what comes meanwhile, the end of the cycle.

    Args:
        settings: Of any such controller.
        cycle: s.
        target: Address and port its packets go to.

    Attributes:
        cycles: Of its clock so far.
        left_out: Of these, without a packet because this computer was too busy.
        elapsed: s on its clock when the cycle began.
    """

    def __init__(self, settings: CyclicSettings, cycle: float, target: tuple[str, int]) -> None:
        self.cycles = self.left_out = 0
        self.elapsed = 0.0
        self._wire = FaultyWire(settings.faults)
        self._shared, self._cycle, self._target = settings, cycle, target
        self._grid = MotionGrid(settings.motion, cycle)

    @property
    @abstractmethod
    def report(self) -> R:
        """Returns the report so far."""

    async def run(self, *, stop: asyncio.Event | None = None) -> R:
        """Returns the report when there is no more to send, or it is stopped.

        Args:
            stop: Set to end it after the cycle that runs.
        """
        settings = self._shared
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(
            lambda: Datagrams(self.take), local_addr=(settings.host, settings.own_port)
        )
        pace = Pace(self._cycle)
        try:
            while not (stop is not None and stop.is_set()):
                packet = self.next_packet()
                if packet is None:
                    break
                for datagram in self._wire.transmit([packet], self.elapsed):
                    transport.sendto(datagram, self._target)
                self.close_cycle(short=await pace.wait())
                if settings.keeps_time:
                    self.leave_out(pace.skip_overdue())
        finally:
            transport.close()
        return self.report

    def next_packet(self) -> bytes | None:
        """Returns the packet of the cycle that begins; None when there is no more to send."""
        number, last = self.cycles, self._shared.cycles
        elapsed = number * self._cycle
        over = last is not None and number >= last
        if over or self._is_over() or elapsed > self._shared.motion.duration:
            return None
        self.elapsed = elapsed
        silence = FaultKind.SILENCE
        if not self._shows(silence) and showing(
            self._shared.faults, silence, elapsed - self._cycle
        ):
            self._restart()
        self.cycles += 1
        return self._packet(number)

    def leave_out(self, cycles: int) -> None:
        """Lets cycles pass without a packet."""
        self.cycles += cycles
        self.left_out += cycles

    @abstractmethod
    def take(self, data: bytes) -> None:
        """Processes a datagram that came during the cycle."""

    def close_cycle(self, *, short: bool = False) -> None:
        """Ends the cycle.

        Args:
            short: Whether the simulator gave it less time than a controller would.
        """

    @abstractmethod
    def _packet(self, number: int) -> bytes:
        """Returns the packet of a cycle, counted from zero."""

    @abstractmethod
    def _restart(self) -> None:
        """Restarts after a silence."""

    def _is_over(self) -> bool:
        """Returns whether it sends no more."""
        return False

    def _shows(self, kind: FaultKind) -> bool:
        """Returns whether a kind of fault shows in this cycle."""
        return showing(self._shared.faults, kind, self.elapsed)


class Datagrams(asyncio.DatagramProtocol):
    """Forwards every datagram; a missing receiver at the other end is no error.

    Args:
        take: Called with each.
    """

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Hands it on."""
        self._take(data)

    def error_received(self, exc: Exception) -> None:
        """Ignores the error: the datagram stays without an answer."""
