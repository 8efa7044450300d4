"""The link to a KUKA controller: answers each packet at once, then reads it.

A packet that cannot be read is not answered, and one that has been answered is not answered again:
with RSI_ON(#RELATIVE) a second answer could move the robot a second time.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.blocks import JointBlock
from robotrue.online.device_defaults import RSI_CYCLE_MS, RSI_PORT
from robotrue.online.guard import CorrectionGuard
from robotrue.online.link import (
    CORRECTION_MODES,
    LinkState,
    RobotLinkSettings,
    Role,
    StreamProtocol,
    StreamSettings,
)
from robotrue.online.net_address import read_own_address
from robotrue.online.robot_correction import Correction, CorrectionMode, no_correction
from robotrue.online.robot_link import RobotLink
from robotrue.online.rsi import (
    RobPacket,
    SeenPacket,
    packet_flags,
    read_ipoc,
    read_late,
    read_rob,
    read_rob_fast,
    rob_block,
    rsi_sequence,
)
from robotrue.online.rsi_answer import RsiBooking, SenWriter
from robotrue.online.rsi_config import RsiConfig, read_rsi_config, usual_rsi_config
from robotrue.online.sequence import advance
from robotrue.online.udp import Address

_REMEMBERED: Final = 128
"""Packets whose answers are remembered: a count that is further back is another clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiSettings(RobotLinkSettings):
    """Settings of a KUKA controller; the usual port is in its configuration file.

    Attributes:
        config: EthernetConfig.xml that the controller runs, or the usual one.
        cycle_ms: 4 (IPO_FAST) or 12 (IPO).
        trust_restart: Whether a Delay near zero after a pause means RSI_ON, with no correction.
    """

    config: RsiConfig
    cycle_ms: int
    trust_restart: bool = False

    def open_link(
        self, corrector: CorrectionGuard | None, before: LinkState | None = None
    ) -> RsiSource:
        """Returns the link, which listens and answers from now on."""
        return RsiSource(self, corrector, before=before)

    def check_corrections(self) -> CorrectionMode:
        """Returns the mode, if corrections can be sent safely.

        Raises:
            ConfigurationError: The mode is not stated, the controller takes no answers or does not
                count late ones, or HOLDON would make a missed answer move the robot.
        """
        if self.mode is None:
            raise ConfigurationError(
                "corrections, and not stated whether the controller adds them up.",
                source=self.name,
                hint="mode=relative or mode=absolute, as in RSI_ON of the running program.",
            )
        if self.config.only_send:
            raise ConfigurationError(
                "ONLYSEND is TRUE: the controller takes no corrections.", source=self.name
            )
        if all(e.tag != "Delay" for e in self.config.send):
            raise ConfigurationError(
                "corrections to a controller that does not report late answers.",
                source=self.name,
                hint='<ELEMENT TAG="DEF_Delay" TYPE="LONG" INDX="INTERNAL"/> under SEND.',
            )
        hold = self.mode is CorrectionMode.ABSOLUTE
        missing = [f"RKorr.{axis}" for axis in "XYZ" if not self.config.receives(f"RKorr.{axis}")]
        if missing:
            raise ConfigurationError(
                f"the controller takes no {', '.join(missing)}.",
                source=self.name,
                hint=f'<ELEMENT TAG="{missing[0]}" TYPE="DOUBLE" .../> under RECEIVE.',
            )
        for e in (e for e in self.config.receive if e.tag.startswith("RKorr.")):
            if e.hold is not hold:
                moves = "would jump back" if hold else "would move on"
                raise ConfigurationError(
                    f'{e.tag} has HOLDON="{int(not hold)}" with {self.mode.value} corrections: the '
                    f"robot {moves} at every missed answer.",
                    source=self.name,
                    hint=f'HOLDON="{int(hold)}" for RKorr in EthernetConfig.xml.',
                )
        return self.mode


class RsiSource(RobotLink[SeenPacket]):
    """A KUKA controller as a source of :class:`~robotrue.online.blocks.JointBlock`.

    Listens and answers once constructed, with no correction unless a corrector is given.

    Args:
        settings: Properties that no packet states.
        corrector: Called for each answer, from the link's thread.
        before: State of the ended link that this one replaces.

    Raises:
        ConfigurationError: The address is not available, another cycle, or corrections that cannot
            be sent safely.
    """

    def __init__(
        self,
        settings: RsiSettings,
        corrector: CorrectionGuard | None = None,
        *,
        before: LinkState | None = None,
    ) -> None:
        mode = CorrectionMode.ABSOLUTE if corrector is None else settings.check_corrections()
        super().__init__(
            settings,
            corrector,
            port=settings.config.port if settings.port is None else settings.port,
            cycle=settings.cycle_ms * 1e-3,
            watch=rsi_sequence(settings.cycle_ms),
            before=before,
        )
        self.settings = settings
        self._rest = no_correction(mode)
        self._writer = None if settings.config.only_send else SenWriter(settings.config, mode)
        self._answered: deque[int] = deque(maxlen=_REMEMBERED)
        self._booking = None
        if corrector is not None:
            watch = None if before is None else before.watch
            self._booking = RsiBooking(
                corrector, settings.cycle_ms, watch, trust_restart=settings.trust_restart
            )
        self._endpoint.start()

    def _packet(self, data: bytes, sender: Address, host_time: float, *, begins: bool) -> None:
        """Answers first, by IPOC and Delay alone; the first of a session is read whole before."""
        if begins:
            packet = read_rob(data, self.settings.config)
            packet_flags(packet)
            same = self._begin(sender)
            self._answered.clear()
            moves = self._book_answer(packet.ipoc, packet.late, host_time, same=same, silent=True)
            self._answer(packet.ipoc, sender, host_time, moves=moves)
        else:
            ipoc = read_ipoc(data)
            moves = self._booking is not None and self._book_answer(
                ipoc, read_late(data), host_time
            )
            self._answer(ipoc, sender, host_time, moves=moves)
            packet = read_rob_fast(data)
        self._watch_counts(packet, host_time)

    def _book_answer(
        self,
        ipoc: int,
        late: int | None,
        host_time: float,
        *,
        same: bool = True,
        silent: bool = False,
    ) -> bool:
        """Records the answer before; returns whether this packet's answer may move the robot."""
        if self._booking is None:
            return False
        if late is None:
            raise FormatError("RSI packet without Delay: the fate of the answers is unknown.")
        return self._booking.packet(ipoc, late, host_time, same=same, silent=silent)

    def _answer(self, ipoc: int, sender: Address, host_time: float, *, moves: bool) -> None:
        if self._writer is None or ipoc in self._answered:
            return
        self._answered.append(ipoc)
        correction: Correction | None = self._rest
        if self._corrector is not None:
            # computed now: the packet may have waited, and estimates have come since
            now = time.monotonic()
            correction = self._corrector.next(now) if moves else self._corrector.hold()
        if correction is None:
            return
        if self._endpoint.send(self._writer.write(ipoc, correction), sender):
            self.turnaround.add(time.monotonic() - host_time)

    def _watch_counts(self, packet: RobPacket, host_time: float) -> None:
        """Watches the counts."""
        watch = self._watch
        now = watch.late_count
        older = watch.last is not None and (
            0 <= watch.last - packet.ipoc <= watch.window * watch.step
        )
        if packet.late is not None and not older:
            now = packet.late
        self._watch, flags = advance(watch, packet.ipoc, host_time, late_count=now)
        wrong = packet_flags(packet) | flags
        self._keep((packet, host_time, flags), packet.ipoc, host_time, wrong)

    def _block(self, kept: list[SeenPacket]) -> JointBlock:
        return rob_block(kept)


OPTIONS: Final = {
    "config": "FILE, EthernetConfig.xml of the controller",
    "cycle": "4ms or 12ms",
    "mode": "relative or absolute, as in RSI_ON of the running program",
}


def read_rsi_address(address: str, role: Role, settings: StreamSettings) -> RsiSettings:
    """Returns the settings of a link to a KUKA controller.

    Raises:
        ConfigurationError: An invalid option or value, or another port than its file states.
        FormatError: A configuration that cannot be read.
    """
    where, options = read_own_address(address, RSI_PORT, OPTIONS)
    mode = options.word("mode", CORRECTION_MODES)
    path = options.text("config")
    if path is None:
        config = usual_rsi_config(where.host, where.port, hold=mode != "relative")
    else:
        config = read_rsi_config(path)
        where, _ = read_own_address(address, config.port, OPTIONS)
        if where.port not in (0, config.port):
            raise ConfigurationError(
                f"port {where.port}, but the controller sends to {config.port} by its {path}.",
                source=where.shown,
                hint=f"rsi://{where.host}:{config.port}",
            )
    return RsiSettings(
        name=where.shown,
        config=config,
        cycle_ms=options.whole("cycle", "ms", default=RSI_CYCLE_MS),
        mode=None if mode is None else CorrectionMode(mode),
        host=where.host,
        port=where.port,
        peer=settings.peer,
        trust_restart=settings.trust_restart,
    )


PROTOCOL: Final = StreamProtocol(
    example="rsi://0.0.0.0:49152?config=EthernetConfig.xml&cycle=4ms",
    options=OPTIONS,
    read=read_rsi_address,
    lacks={"force": "a KUKA controller sends no force by RSI alone"},
    takes_corrections=True,
)
