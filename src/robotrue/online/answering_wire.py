"""Messages between the service and its answering process, one per packet of a socket pair.

A message is ``I`` bytes of JSON, the JSON, and a frame of the record where it holds samples. The
socket keeps messages whole, so neither side ever reads half of one.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeVar

from robotrue import errors
from robotrue.core.columns import concat
from robotrue.core.document_decoder import decode, encode
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online.blocks import Block, ForceBlock, JointBlock
from robotrue.online.egm_link import EgmSettings
from robotrue.online.guard import CorrectionLimits, GuardState, check_whole
from robotrue.online.link import Health, LinkState
from robotrue.online.record_frames import Kind, frame_bytes
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_link import RsiSettings
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import Address

LinkSettings = RsiSettings | EgmSettings
"""Of controllers that a separate process can answer."""
B = TypeVar("B", JointBlock, ForceBlock)
M = TypeVar("M")

MOST: Final = 1 << 17
"""Bytes of a message, at most."""
_ROWS: Final = 256
"""Samples in one message: with twelve axes half of what a message may hold."""
_LENGTH: Final = struct.Struct("<I")


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedLink:
    """State of an ended answering process, handed to its successor.

    Attributes:
        link: Of its link.
        guard: Of its guard, if it had one.
        why: What ended it.
    """

    link: LinkState
    guard: GuardState | None
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Opening:
    """The first message of the service.

    Attributes:
        settings: Of the link.
        limits: Of the guard; None corrects nothing.
        mode: What the controller does with an answer; None without limits.
        before: The ended process that this one replaces.
    """

    settings: LinkSettings
    limits: CorrectionLimits | None = None
    mode: CorrectionMode | None = None
    before: EndedLink | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkRequest:
    """Request of the service to the answering process.

    Attributes:
        do: Which of the guard's requests, ``force`` for its stream, or ``close``.
        shift: m, of ``want``.
        turn: rad, of ``want``.
        time: s on the monotonic clock, of ``want``.
        why: Of ``fault``.
    """

    do: Literal["want", "fault", "release", "rearm", "force", "close"]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    time: float = math.nan
    why: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnsweringFault:
    """An error of the answering process.

    Attributes:
        kind: Its class in :mod:`robotrue.errors`.
        message, source, hint: As of :class:`~robotrue.errors.RobotrueError`.
    """

    kind: str
    message: str
    source: str | None
    hint: str | None

    @classmethod
    def of(cls, error: RobotrueError) -> AnsweringFault:
        """Returns an error as a message."""
        kind = type(error).__name__
        return cls(kind=kind, message=error.message, source=error.source, hint=error.hint)

    def error(self) -> RobotrueError:
        """Returns the reported error."""
        kind = getattr(errors, self.kind, ConfigurationError)
        made: RobotrueError = kind(self.message, source=self.source, hint=self.hint)
        return made


@dataclass(frozen=True, slots=True, kw_only=True)
class AnsweringReport:
    """Report of the answering process: brief with each answer, in full from time to time.

    Attributes:
        guard: State of its guard.
        watch: The count of the controller's packets, in brief.
        peer: Their sender, abbreviated.
        link: In full, like the others.
        health: Counters of the link.
        force: Counters of the measured force.
        preferred: Whether its thread may run before all others.
        address: Where it listens; in the first report.
        fault: Its error.
    """

    guard: GuardState | None = None
    watch: SequenceState | None = None
    peer: Address | None = None
    link: LinkState | None = None
    health: Health | None = None
    force: Health | None = None
    preferred: bool = False
    address: Address | None = None
    fault: AnsweringFault | None = None


def write_message(content: Opening | LinkRequest | AnsweringReport, frame: bytes = b"") -> bytes:
    """Returns the bytes of a message."""
    text = json.dumps(encode(content), separators=(",", ":")).encode()
    return b"".join((_LENGTH.pack(len(text)), text, frame))


def read_message(data: bytes, kind: type[M]) -> tuple[M, bytes]:
    """Returns the content of a message, and its frame or nothing."""
    end = _LENGTH.size + _LENGTH.unpack_from(data)[0]
    return decode(kind, json.loads(data[_LENGTH.size : end])), data[end:]


def frames(block: Block) -> Iterator[bytes]:
    """Gives a block as frames that fit into messages."""
    kind = Kind.JOINTS if isinstance(block, JointBlock) else Kind.FORCE
    if len(block) <= _ROWS:
        yield frame_bytes(kind, 0, block)
        return
    for start in range(0, len(block), _ROWS):
        yield frame_bytes(kind, 0, block.take(slice(start, start + _ROWS)))


def join_blocks(blocks: list[B]) -> list[B]:
    """Returns consecutive blocks of one stream as one; as many as arms differ in their joints."""
    if len({_alike(block) for block in blocks}) != 1:
        return blocks
    return [concat(blocks)]


def _alike(block: Block) -> object:
    return block.joints.shape[1] if isinstance(block, JointBlock) else block.frame


class RemoteGuard:
    """The :class:`~robotrue.online.guard.CorrectionGuard` of an answering process, seen from here.

    Given to :class:`~robotrue.online.answering_link.AnsweringLink`, which has it made there. What
    :meth:`state` returns was so a few milliseconds ago.

    Args:
        limits: Its limits.
        mode: What the controller does with an answer.
    """

    def __init__(self, limits: CorrectionLimits, mode: CorrectionMode) -> None:
        self.limits, self.mode = limits, mode
        self._state = GuardState()
        self._ask: Callable[[LinkRequest], None] = lambda _: None

    def want(self, correction: Correction, host_time: float) -> None:
        """Requests a total correction, in ABSOLUTE terms.

        Raises:
            ModelMismatchError: It is meant as an increment.
        """
        check_whole(correction)
        shift, turn = tuple(correction.shift.tolist()), tuple(correction.turn.tolist())
        self._ask(LinkRequest(do="want", shift=shift, turn=turn, time=host_time))

    def fault(self, why: str) -> None:
        """Trips the watchdog, for the stated reason."""
        self._ask(LinkRequest(do="fault", why=why))

    def release(self) -> None:
        """Goes to zero at the stated rate, for good."""
        self._ask(LinkRequest(do="release"))

    def rearm(self) -> None:
        """Lets corrections grow again after a trip."""
        self._ask(LinkRequest(do="rearm"))

    def state(self) -> GuardState:
        """Returns the guard's state in the latest report."""
        return self._state

    def connect(self, ask: Callable[[LinkRequest], None]) -> None:
        """Sets the function that sends requests to it."""
        self._ask = ask

    def take_state(self, state: GuardState) -> None:
        """Stores the reported state."""
        self._state = state

    def mark_ended(self, why: str) -> GuardState:
        """Records that its process has ended; returns the state before."""
        before = self._state
        if before.active:
            self._state = replace(before, active=False, why=why, trips=before.trips + 1)
        return before
