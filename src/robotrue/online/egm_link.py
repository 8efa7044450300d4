"""The link to an ABB controller: its joints and measured force, and path corrections back.

The generation of egm.proto is stated, never guessed; a message whose force is empty under it is
refused with the other generation as the hint. Corrections are sent as the whole offset that is to
be held: ABB's own note in the proto calls the value a measurement in the frame of the sensor on
the tool, so try with a small limit whether this controller holds it.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import ClassVar, Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.blocks import Flag, ForceBlock, JointBlock
from robotrue.online.device_defaults import EGM_PORT
from robotrue.online.egm import (
    GuidanceState,
    RobotWare,
    SeenMessage,
    egm_force_block,
    egm_joint_block,
    egm_sequence,
    read_robot,
    write_path_correction,
)
from robotrue.online.guard import CorrectionGuard
from robotrue.online.link import (
    CORRECTION_MODES,
    FORCE_FRAMES,
    Health,
    LinkState,
    RobotLinkSettings,
    Role,
    StreamProtocol,
    StreamSettings,
)
from robotrue.online.net_address import read_own_address
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.robot_link import RobotLink
from robotrue.online.sequence import SequenceState, advance
from robotrue.online.udp import Address, Inbox

_CYCLE: Final = 4e-3
_UNSEEN: Final = 25
"""Messages lost in a row in which the guidance may have ended and started again."""
_STALE: Final = Flag.REPEATED | Flag.REORDERED
"""Messages without an answer: the controller has had an answer to a newer one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmSettings(RobotLinkSettings):
    """Settings of an ABB controller; the usual port is 6510.

    Attributes:
        generation: RobotWare 6 or 7.
        force_frame: Axes in which the controller reports the measured force.
    """

    generation: RobotWare
    force_frame: str = "sensor"
    sends_force: ClassVar[bool] = True

    def open_link(
        self, corrector: CorrectionGuard | None, before: LinkState | None = None
    ) -> EgmSource:
        """Returns the link, which listens and answers from now on."""
        return EgmSource(self, corrector, before=before)

    def check_corrections(self) -> CorrectionMode:
        """Returns the mode, if corrections can be sent safely.

        Raises:
            ConfigurationError: Another mode than absolute, or none.
        """
        if self.mode is not CorrectionMode.ABSOLUTE:
            given = "none" if self.mode is None else self.mode.value
            raise ConfigurationError(
                f"corrections by EGM with mode {given}, expected absolute: the controller plans "
                "its path less often than it receives answers, and would lose or repeat "
                "increments.",
                source=self.name,
                hint="mode=absolute, after a try with a small limit.",
            )
        return self.mode


class EgmSource(RobotLink[SeenMessage]):
    """An ABB controller as a source of :class:`~robotrue.online.blocks.JointBlock`.

    Listens once constructed; answers only where a corrector is given, and only while the controller
    reports that it guides the robot.

    Args:
        settings: Properties that no message states.
        corrector: Called for each answer, from the link's thread.
        before: State of the ended link that this one replaces.

    Raises:
        ConfigurationError: The address is not available, or corrections in a mode that is not
            stated or cannot be sent.
    """

    def __init__(
        self,
        settings: EgmSettings,
        corrector: CorrectionGuard | None = None,
        *,
        before: LinkState | None = None,
    ) -> None:
        if corrector is not None:
            settings.check_corrections()
        super().__init__(
            settings,
            corrector,
            port=EGM_PORT if settings.port is None else settings.port,
            cycle=_CYCLE,
            watch=egm_sequence(),
            before=before,
        )
        self.settings = settings
        self._own = 0
        self._guided = before is not None
        self._view: EgmForce | None = None
        self._endpoint.start()

    def force(self) -> EgmForce:
        """Returns the force in the same messages as a separate source; always the same object."""
        if self._view is None:
            self._view = EgmForce(self)
        return self._view

    def _packet(self, data: bytes, sender: Address, host_time: float, *, begins: bool) -> None:
        """Reads, answers, and keeps joints and force."""
        robot = read_robot(data, self.settings.generation)
        wrong = int(egm_joint_block([(robot, host_time, Flag.NONE)]).flags[0])
        same = self._begin(sender) if begins else True
        before = self._watch
        self._watch, flags = advance(before, robot.seqno, host_time)
        if self._corrector is not None:
            self._follow(robot.guidance, before, flags, same=same, silent=begins)
            if not flags & _STALE and robot.guidance is GuidanceState.RUNNING:
                self._answer(self._corrector, sender, host_time)
            missed = max(0, self._watch.lost - before.lost) + bool(flags & Flag.LATE)
            if missed:
                self._corrector.count_late(missed, host_time)
        seen = robot, host_time, flags
        self._keep(seen, robot.seqno, host_time, flags | Flag(wrong))
        if self._view is not None:
            self._view.take(seen)

    def _block(self, kept: list[SeenMessage]) -> JointBlock:
        return egm_joint_block(kept)

    def _follow(
        self,
        guidance: GuidanceState | None,
        before: SequenceState,
        flags: Flag,
        *,
        same: bool,
        silent: bool,
    ) -> None:
        """Reports a guidance to the corrector that ended, or may have ended unseen."""
        if self._corrector is None or not self._guided:
            return
        if guidance is not GuidanceState.RUNNING:
            if not flags & _STALE:
                self._guided = False
                self._corrector.note_restart(certain=same)
        elif silent and same and self._watch.total - before.total <= _UNSEEN:
            self._corrector.fault("no packet of the controller for a while")
        elif silent or flags & Flag.CLOCK_JUMP or self._watch.total - before.total > _UNSEEN:
            self._corrector.note_restart(certain=False)

    def _answer(self, corrector: CorrectionGuard, sender: Address, host_time: float) -> None:
        # computed now: the message may have waited, and estimates have come since
        now = time.monotonic()
        correction, age = corrector.next(now), corrector.age(now)
        if correction is None:
            return
        self._guided = True
        message = write_path_correction(self._own, round(now * 1e3), correction, age)
        self._own += 1
        if self._endpoint.send(message, sender):
            self.turnaround.add(time.monotonic() - host_time)

    def _over(self, fault: BaseException | None) -> None:
        super()._over(fault)
        if self._view is not None:
            self._view.end(fault)


class EgmForce:
    """Measured force of an EGM link as a separate source; ends with the link."""

    def __init__(self, link: EgmSource) -> None:
        self._link = link
        self._inbox: Inbox[SeenMessage] = Inbox(link.settings.waiting)
        self._health = Health(name=f"{link.settings.name} force", connected=False)

    async def blocks(self) -> AsyncIterator[ForceBlock]:
        """Gives samples as they come; ends when the link is closed."""
        while messages := await self._inbox.take():
            yield egm_force_block(messages, self._link.settings.force_frame)

    async def close(self) -> None:
        """Gives no more; the link itself stays open."""
        self._inbox.close()

    def health(self) -> Health:
        """Returns the current counters; missing packets count as lost."""
        link, fault = self._link.health(), self._health.last_fault
        return replace(
            self._health,
            connected=link.connected and not fault,
            lost=link.lost,
            late=link.late,
            reconnects=link.reconnects,
            last_fault=self._inbox.crowding or fault or link.last_fault,
        )

    def take(self, seen: SeenMessage) -> None:
        """Stores the force of a message; refuses a message without one here."""
        try:
            egm_force_block([seen], self._link.settings.force_frame)
        except FormatError as refused:
            self._health.refuse(str(refused))
            return
        self._health.received += 1
        self._health.last_fault = ""
        self._inbox.put(seen)

    def end(self, fault: BaseException | None) -> None:
        """Closes the inbox: no more messages will come."""
        self._inbox.close(fault)


OPTIONS: Final = {
    "robotware": "6 or 7",
    "mode": "absolute",
    "frame": "sensor, tool or base, axes of the measured force",
}


def name_egm_link(address: str) -> str:
    """Returns the name of the link at an address.

    Raises:
        ConfigurationError: An address or option that cannot be read.
    """
    return read_own_address(address, EGM_PORT, OPTIONS)[0].shown


def read_egm_address(address: str, role: Role, settings: StreamSettings) -> EgmSettings:
    """Returns the settings of a link to an ABB controller.

    Raises:
        ConfigurationError: An invalid option or value, or RobotWare is not stated.
    """
    where, options = read_own_address(address, EGM_PORT, OPTIONS)
    generation = options.word("robotware", ("6", "7"))
    if generation is None:
        raise ConfigurationError(
            "RobotWare 6 or 7 is not stated, and the messages of both versions are confused "
            "without an error.",
            source=address,
            hint="egm://0.0.0.0:6510?robotware=7",
        )
    mode = options.word("mode", CORRECTION_MODES)
    return EgmSettings(
        name=where.shown,
        generation=RobotWare.SIX if generation == "6" else RobotWare.SEVEN,
        mode=None if mode is None else CorrectionMode(mode),
        force_frame=options.word("frame", FORCE_FRAMES) or "sensor",
        host=where.host,
        port=where.port,
        peer=settings.peer,
    )


PROTOCOL: Final = StreamProtocol(
    example="egm://0.0.0.0:6510?robotware=7",
    options=OPTIONS,
    read=read_egm_address,
    takes_corrections=True,
    takes_path_axes=True,
    link_of_force=name_egm_link,
    force_rate=1.0 / _CYCLE,
)
