"""A guard that stands in another process: what is asked of it here, it does there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from robotrue.online.guard import CorrectionLimits, GuardState, check_whole
from robotrue.online.robot_correction import Correction, CorrectionMode

Tell = Callable[[Mapping[str, Any]], None]


class RemoteGuard:
    """The :class:`~robotrue.online.guard.CorrectionGuard` of an answering process, seen from here.

    Given to :class:`~robotrue.online.answering_link.AnsweringLink`, which has it made there. What
    it tells was so a few milliseconds ago.

    Args:
        limits: What it keeps to.
        mode: What the controller does with an answer.
    """

    def __init__(self, limits: CorrectionLimits, mode: CorrectionMode) -> None:
        self.limits, self.mode = limits, mode
        self._state = GuardState()
        self._tell: Tell | None = None

    def want(self, correction: Correction, host_time: float) -> None:
        """Asks for a correction to be reached: the whole of it, in ABSOLUTE terms.

        Raises:
            ModelMismatchError: It is meant as an increment.
        """
        check_whole(correction)
        by = [*correction.shift.tolist(), *correction.turn.tolist()]
        self._ask({"do": "want", "by": by, "time": host_time})

    def doubt(self, why: str) -> None:
        """Takes note that the estimate is invalid."""
        self.fault(why)

    def fault(self, why: str) -> None:
        """Trips the watchdog, for the stated reason."""
        self._ask({"do": "fault", "why": why})

    def release(self) -> None:
        """Goes to zero at the stated rate, for good."""
        self._ask({"do": "release"})

    def rearm(self) -> None:
        """Lets corrections grow again after a trip."""
        self._ask({"do": "rearm"})

    @property
    def why(self) -> str:
        """Why corrections are at zero, or empty."""
        return self._state.why

    @property
    def trips(self) -> int:
        """How often the watchdog has tripped."""
        return self._state.trips

    @property
    def active(self) -> bool:
        """Whether estimates are followed."""
        return self._state.active

    @property
    def at_rest(self) -> bool:
        """Whether the robot holds no correction."""
        return self._state.at_rest

    @property
    def held(self) -> Correction:
        """The whole correction that the robot holds, as far as its controller has told."""
        return self._state.held

    def state(self) -> GuardState:
        """Returns how it stood when it was last heard of."""
        return self._state

    def connect(self, tell: Tell) -> None:
        """Says how it is reached."""
        self._tell = tell

    def take_state(self, state: GuardState) -> None:
        """Takes note of how it stands."""
        self._state = state

    def mark_ended(self, why: str) -> GuardState:
        """Takes note that its process has ended; returns how it stood before."""
        before = self._state
        if before.active:
            self._state = replace(before, active=False, why=why, trips=before.trips + 1)
        return before

    def _ask(self, what: Mapping[str, Any]) -> None:
        if self._tell is not None:
            self._tell(what)
