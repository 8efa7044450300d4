"""``<Sen>`` answers to a KUKA controller, and whether it applied each, from IPOC and Delay.

Delay grows by one in each cycle that ends without an answer. Of two packets that are ``n`` cycles
apart the later one has therefore counted ``n - 1`` more if the answer to the earlier was taken: the
packets between were lost and not answered. Every other number leaves it undetermined. Controllers
that set Delay back to zero with the next answer in time are read likewise. Some count from the
first answer on, so the first answers of a session move nothing: one of them arrives.

Assumptions: the controller takes an answer once, none after the cycle that follows its own, and
from the last packet before RSI_OFF to the first after RSI_ON :data:`RESTART` cycles pass or more.

Packets are written and answers read here for simulated controllers.
"""

from __future__ import annotations

from typing import Final
from xml.sax.saxutils import quoteattr

from robotrue.core.rotations import abc_from_matrix, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.online.guard import CorrectionGuard
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi import JOINTS, POSE, RobPacket, read_values
from robotrue.online.rsi_config import RsiConfig
from robotrue.online.sequence import SequenceState
from robotrue.online.xml_text import parse_xml

_STRAIGHT: Final = [0.0, 0.0, 0.0]
_UNSEEN: Final = 5e-7
"""mm and deg; what six decimals print as zero."""


class SenWriter:
    """Writes answers; all that does not change is prepared beforehand.

    Args:
        config: Which elements the controller takes.
        mode: Mode of RSI_ON in the running program.

    Raises:
        ConfigurationError: The link takes no answers.
    """

    def __init__(self, config: RsiConfig, mode: CorrectionMode) -> None:
        if config.only_send:
            raise ConfigurationError(
                "ONLYSEND is TRUE: the controller takes no answers.", hint="set it to FALSE."
            )
        self._mode = mode
        taken = [(name, config.receives(f"RKorr.{name}")) for name in POSE]
        self._missing = [(k, name) for k, (name, element) in enumerate(taken) if element is None]
        self._places = [k for k, (_, element) in enumerate(taken) if element is not None]
        values = "".join(
            f' {name}="{"%.6f" if element.kind == "DOUBLE" else "%d"}"'
            for name, element in taken
            if element is not None
        )
        kind = quoteattr(config.sen_type).replace("%", "%%")
        body = f"<RKorr{values} />" if values else ""
        answer = f"<Sen Type={kind}>{body}<IPOC>%d</IPOC></Sen>"
        self._answer = answer.encode("ascii", "xmlcharrefreplace")

    def write(self, ipoc: int, correction: Correction) -> bytes:
        """Returns the answer to the packet of an IPOC, unchanged.

        Args:
            ipoc: That of the packet answered.
            correction: Written as RKorr, X Y Z in mm and A B C in deg, to 1e-6 of them.

        Raises:
            ConfigurationError: The controller does not take this direction.
            ModelMismatchError: A correction for the other mode.
        """
        if correction.mode is not self._mode:
            raise ModelMismatchError(
                f"a correction meant as {correction.mode.value} for a controller that takes it as "
                f"{self._mode.value}.",
                hint="RSI_ON(#RELATIVE) adds it up in every cycle, RSI_ON(#ABSOLUTE) does not.",
            )
        x, y, z = correction.shift.tolist()
        a, b, c = turn = correction.turn.tolist()
        if turn != _STRAIGHT:
            a, b, c = abc_from_matrix(matrix_from_rotation_vector(correction.turn)).tolist()
        # without the sign of a zero
        values = (
            x / MM + 0.0, y / MM + 0.0, z / MM + 0.0, a / DEG + 0.0, b / DEG + 0.0, c / DEG + 0.0,
        )  # fmt: skip
        if not self._missing:
            return self._answer % (*values, ipoc)
        for k, name in self._missing:
            if abs(number := values[k]) >= _UNSEEN:
                raise ConfigurationError(
                    f"the controller takes no RKorr.{name}, and {number:.6f} is to be sent.",
                    hint=f'<ELEMENT TAG="RKorr.{name}" .../> under RECEIVE, or correct without it.',
                )
        return self._answer % (*(values[k] for k in self._places), ipoc)


def write_rob(packet: RobPacket) -> bytes:
    """Returns a packet as a controller sends it, for simulators and tests."""
    values: dict[str, float] = {}
    for tag, names, numbers in (
        ("RIst", POSE, packet.pose_mm_deg),
        ("AIPos", JOINTS, packet.joints_deg),
    ):
        if numbers is not None:
            values |= {f"{tag}.{n}": v for n, v in zip(names, numbers, strict=True)}
    if packet.late is not None:
        values["Delay.D"] = packet.late
    groups: dict[str, str] = {}
    for tag, number in (values | dict(packet.signals)).items():
        group, _, name = tag.partition(".")
        text = str(int(number)) if tag == "Delay.D" else f"{number:.6f}"
        groups[group] = groups.get(group, "") + (f' {name}="{text}"' if name else text)
    parts = [
        f"<{group}{body} />" if body.startswith(" ") else f"<{group}>{body}</{group}>"
        for group, body in groups.items()
    ]
    text = f'<Rob Type="KUKA">{"".join(parts)}<IPOC>{packet.ipoc}</IPOC></Rob>'
    return text.encode("ascii", "xmlcharrefreplace")


def read_sen(data: bytes, config: RsiConfig, ipoc: int) -> dict[str, float]:
    """Returns the values of an answer as a controller reads it: RKorr.X in mm, RKorr.A in deg.

    Raises:
        FormatError: Not a ``<Sen>``, another type, or the IPOC of another packet.
    """
    root = parse_xml(data, "RSI answer")
    sen_type = root.get("Type", "")
    if root.tag != "Sen" or sen_type != config.sen_type:
        raise FormatError(
            f"RSI answer <{root.tag} Type={sen_type!r}>, expected <Sen Type={config.sen_type!r}>.",
            hint="SENTYPE of EthernetConfig.xml.",
        )
    answered, values = read_values(root)
    if answered != ipoc:
        raise FormatError(f"RSI answer to IPOC {answered}, expected {ipoc}.")
    return values


RESTART: Final = 20
"""Cycles, at least, from the last packet of a session to the first of the next, less the most that
a packet is late."""
SILENCE: Final = 25
"""Cycles without a packet after which the controller is taken as gone."""
_OLD: Final = 100
"""Cycles by which a packet may come late; farther back it is of another clock."""
_FEW: Final = 3
"""Answers that a new session may have missed before we heard of it."""
_NEAR: Final = (0.05, 0.2)
"""s, and share of a pause, by which the IPOC may differ from our clock after it."""


class RsiBooking:
    """Books each answer with the corrector as taken, or as open.

    Args:
        corrector: Updated before it computes the next answer.
        cycle_ms: Of the controller.
        before: Of a link that has ended; its last answers may not be recorded.
        trust_restart: Whether a Delay near zero after a pause is a new session, which holds no
            correction. A count that was set back otherwise looks the same.
    """

    def __init__(
        self,
        corrector: CorrectionGuard,
        cycle_ms: int,
        before: SequenceState | None = None,
        *,
        trust_restart: bool = False,
    ) -> None:
        self._trust = trust_restart
        self._corrector, self._step = corrector, cycle_ms
        self._ipoc = None if before is None else before.last
        self._late = 0 if before is None else before.late_count
        self._time = float("-inf") if before is None else before.host_time
        self._resumed = self._ipoc is not None
        self._first = SILENCE

    def packet(
        self, ipoc: int, late: int, host_time: float, *, same: bool = True, silent: bool = False
    ) -> bool:
        """Books the answer before; returns whether the answer to this packet may move the robot.

        Args:
            ipoc: Of the packet.
            late: Its Delay.
            host_time: s, when it came.
            same: Whether its sender is that of the packet before, or the only one allowed.
            silent: Whether it ends a pause.
        """
        before, late_before, gap = self._ipoc, self._late, host_time - self._time
        cycles, odd = (1, 0) if before is None else divmod(ipoc - before, self._step)
        if same and not silent and not odd and -_OLD <= cycles <= 0:
            return False
        self._ipoc, self._late, self._time = ipoc, late, host_time
        if before is None:
            self._corrector.book(taken=False)
            return True
        resumed, self._resumed = self._resumed, False
        # less on its clock than on ours: time enough to restart and to set the clock back
        whole = gap <= (cycles + RESTART) * self._step * 1e-3
        if same and whole and not odd and cycles > 0:
            rise = late - late_before
            untold = cycles - (rise if rise >= 0 else late)
            if resumed and 0 <= untold < SILENCE:
                self._first = 0
                self._corrector.book(taken=False)
                self._corrector.add_unreported(untold)
                self._corrector.fault("the controller had no answers for a while")
                return True
            if not resumed and (rise in (cycles - 1, cycles) or late == cycles - 1):
                # a clock that leapt by a cycle looks like a lost packet, but takes no time
                passed = cycles == 1 or gap >= (cycles - 0.5) * self._step * 1e-3
                self._first -= self._first > 0
                self._corrector.book(taken=passed and rise == cycles - 1 and not self._first)
                if rise:
                    self._corrector.count_late(max(rise, 1), host_time)
                if silent:
                    self._corrector.fault("no packet of the controller for a while")
                return True
        self._corrector.book(taken=False)
        if same and not resumed and gap < RESTART * self._step * 1e-3:
            self._corrector.fault(
                f"from packet to packet IPOC went by {ipoc - before} ms, Delay by "
                f"{late - late_before}"
            )
        else:
            certain = same and not odd and self._is_new_session(cycles, late, gap)
            self._first = SILENCE if certain else self._first
            if resumed and not certain:
                # the previous process may have moved the robot after its last report
                self._corrector.add_unreported(SILENCE)
            self._corrector.note_restart(certain=certain)
            self._corrector.book(taken=False)
        return True

    def _is_new_session(self, cycles: int, late: int, gap: float) -> bool:
        """True if RSI restarted during a pause; otherwise Delay would have counted the pause."""
        passed = cycles * self._step * 1e-3
        near = abs(passed - gap) <= _NEAR[0] + _NEAR[1] * gap
        return self._trust and near and cycles >= SILENCE and late <= _FEW
