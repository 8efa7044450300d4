"""Guard between estimates and a moving robot: limits, rates, a ramp and a watchdog.

The correction that the robot holds is kept in whole steps of the wire (1 nm, 1e-6 deg), so that
what was sent adds up to what is held for as long as the service runs. Each answer may change it by
the rate times one cycle at most, however long the computer slept before.

Where the controller adds corrections up (RELATIVE), an answer that it did not confirm may have
moved the robot or not. Its length is then added to the *spread*, the radius around ``held`` in
which the robot is for certain; the spread counts against the limit.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Final

from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.robot_correction import (
    MICRODEGREE,
    NANOMETRE,
    NONE,
    Correction,
    CorrectionMode,
    Steps,
    correction_of,
    step_toward,
    steps_scaled,
    steps_sum,
    steps_within,
)

_EARLY: Final = 1e-3
"""s by which a measurement may lie ahead of the answer: two threads read one clock."""
_HISTORY: Final = 1000
_WIDEST_TURN: Final = 5.0 * DEG
"""Turns are added up as vectors, which holds for small ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionLimits:
    """Limits that a correction never exceeds.

    Attributes:
        shift: m, its largest length.
        shift_rate: m/s, its fastest change.
        cycle: s for which one answer applies at most (RSI 4 or 12 ms).
        turn: rad; 0 never turns the tool.
        turn_rate: rad/s.
        timeout: s after which an estimate is too old.
        ramp: s in which a correction grows to its full size after the start.
        late_answers: That many late answers within ``late_window`` trip the watchdog.
        late_window: s.
        latch: After a trip it stays at zero until it is armed again.
    """

    shift: float
    shift_rate: float
    cycle: float
    turn: float = 0.0
    turn_rate: float = 1.0 * DEG
    timeout: float = 0.1
    ramp: float = 1.0
    late_answers: int = 2
    late_window: float = 1.0
    latch: bool = True

    def __post_init__(self) -> None:
        """Checks."""
        least = {"shift": 1e-6, "shift_rate": 1e-6, "cycle": 1e-4, "timeout": 1e-3}
        least |= {"turn": 0.0, "turn_rate": 1e-3 * DEG, "ramp": 0.0, "late_window": 1e-3}
        for name, low in least.items():
            value = getattr(self, name)
            if not low <= value < math.inf:
                raise ConfigurationError(f"{name} = {value:g}, expected {low:g} or more, in SI.")
        if self.turn > _WIDEST_TURN or self.late_answers < 1:
            raise ConfigurationError(
                f"turn {self.turn / DEG:g} deg, {self.late_answers} late answers; expected at most "
                f"{_WIDEST_TURN / DEG:g} deg and one answer or more."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardState:
    """State of a guard, in whole steps of the wire format.

    Attributes:
        shift: nm that the robot holds.
        turn: 1e-6 deg that it holds.
        trips: How often the watchdog has tripped.
        why: For the last time, or empty.
        active: Whether estimates are followed.
        pending: Of these, what the latest answer added (nm, 1e-6 deg), not confirmed yet.
        spread: Radius in nm and in 1e-6 deg around ``shift`` and ``turn`` that holds the truth.
        refused: Whether corrections cannot begin again before the controller restarts.
        frozen: Whether the robot's correction is too uncertain to move it at all.
    """

    shift: Steps = (0, 0, 0)
    turn: Steps = (0, 0, 0)
    trips: int = 0
    why: str = ""
    active: bool = True
    pending: tuple[Steps, Steps] = ((0, 0, 0), (0, 0, 0))
    spread: tuple[int, int] = (0, 0)
    refused: bool = False
    frozen: bool = False

    @property
    def at_rest(self) -> bool:
        """True if the robot holds no correction, apart from the spread."""
        return self.shift == NONE and self.turn == NONE and not self.frozen

    @property
    def farthest(self) -> float:
        """The largest shift in m that the robot may hold."""
        without = math.hypot(*steps_sum(self.shift, self.pending[0], -1))
        return (max(math.hypot(*self.shift), without) + self.spread[0]) * NANOMETRE

    @property
    def held(self) -> Correction:
        """The whole correction that the robot holds."""
        return correction_of(self.shift, self.turn, CorrectionMode.ABSOLUTE)


class CorrectionGuard:
    """Computes the correction of each cycle and keeps it within the limits.

    A link calls it for each of its answers and reports the controller's state to it, from a
    separate thread.

    It starts at zero, and returns there at the stated rate, without a jump, when the estimate is
    invalid or older than ``timeout``, when answers come late, or when a link sees a fault. ``why``
    states the cause. With ``latch`` it stays there until :meth:`rearm`.

    Args:
        limits: Limits of the correction.
        mode: What the controller does with an answer; for RELATIVE the answers are increments.
    """

    def __init__(self, limits: CorrectionLimits, mode: CorrectionMode) -> None:
        self.limits, self.mode = limits, mode
        self.why = ""
        self.trips = 0
        self._lock = threading.Lock()
        self._shift: Steps = NONE
        self._turn: Steps = NONE
        self._wanted: tuple[Steps, Steps, float] | None = None
        self._pending: tuple[Steps, Steps] = (NONE, NONE)
        self._spread = [0, 0]
        self._doubtful = False
        self._frozen = self._refused = False
        self._late: deque[float] = deque(maxlen=_HISTORY)
        self._time = math.nan
        self._started = math.nan
        self._tripped_at: float | None = None
        self._released = False

    def want(self, correction: Correction, host_time: float) -> None:
        """Sets a total correction to reach, independent of the controller's mode.

        Args:
            correction: In ABSOLUTE terms; beyond the limits it is cut to them.
            host_time: s on the monotonic clock of the measurement it rests on.

        Raises:
            ModelMismatchError: It is meant as an increment.
        """
        check_whole(correction)
        shift = steps_within(correction.shift.tolist(), self.limits.shift, NANOMETRE)
        turn = steps_within(correction.turn.tolist(), self.limits.turn, MICRODEGREE)
        with self._lock:
            if not math.isfinite(host_time):
                self._trip("an estimate without a time")
            elif self._wanted is None or host_time >= self._wanted[2]:
                self._wanted = (shift, turn, host_time)

    def next(self, host_time: float) -> Correction | None:
        """Returns the correction to send now, which is finite and within the limits.

        None where any answer could make the robot jump: then it is not to be answered.

        Args:
            host_time: s on the monotonic clock.
        """
        with self._lock:
            elapsed = self._find_elapsed(host_time)
            gain = self._gain(host_time)
            moved = turned = NONE
            if not (self._frozen or self._doubtful):
                shift, turn = self._aim(gain)
                limits, (spread, turn_spread) = self.limits, self._spread
                moved = _next_step(
                    self._shift,
                    shift,
                    limits.shift_rate * elapsed / NANOMETRE,
                    limits.shift / NANOMETRE - spread,
                )
                turned = _next_step(
                    self._turn,
                    turn,
                    limits.turn_rate * elapsed / MICRODEGREE,
                    limits.turn / MICRODEGREE - turn_spread,
                )
                self._shift = steps_sum(self._shift, moved)
                self._turn = steps_sum(self._turn, turned)
            self._pending = moved, turned
            return self._answer(moved, turned)

    def _aim(self, gain: float) -> tuple[Steps, Steps]:
        """Shift and turn that are aimed for: the wanted ones times the gain, or zero."""
        if not gain > 0.0 or self._wanted is None:
            return NONE, NONE
        shift, turn, _ = self._wanted
        if gain < 1.0:
            return steps_scaled(shift, gain), steps_scaled(turn, gain)
        return shift, turn

    def hold(self) -> Correction | None:
        """Returns the answer to a packet whose cycle is over: it moves nothing, or is not sent."""
        if self.mode is CorrectionMode.ABSOLUTE:
            return None
        return correction_of(NONE, NONE, self.mode)

    def book(self, *, taken: bool) -> None:
        """Records the fate of the previous answer; to be called before the next one.

        Args:
            taken: Whether the controller took it for certain. If not, the next answer moves
                nothing: the controller may take the late one in the same cycle.
        """
        with self._lock:
            self._book(taken=taken)

    def _book(self, *, taken: bool) -> None:
        self._doubtful = not taken
        moved, turned = self._pending
        self._pending = NONE, NONE
        if taken or self.mode is CorrectionMode.ABSOLUTE or moved == turned == NONE:
            return
        self._shift, self._turn = (
            steps_sum(self._shift, moved, -1),
            steps_sum(self._turn, turned, -1),
        )
        self._widen(math.hypot(*moved), math.hypot(*turned))

    def add_unreported(self, answers: int) -> None:
        """Counts answers that the guard before this one gave and did not report."""
        if self.mode is CorrectionMode.RELATIVE and answers > 0:
            limits = self.limits
            with self._lock:
                self._widen(
                    answers * limits.shift_rate * limits.cycle / NANOMETRE,
                    answers * limits.turn_rate * limits.cycle / MICRODEGREE if limits.turn else 0.0,
                )

    def _widen(self, shift: float, turn: float) -> None:
        """Adds to the spread; once its width passes the limit corrections end for good."""
        self._spread[0] += math.ceil(shift)
        self._spread[1] += math.ceil(turn)
        limits = self.limits
        # beyond the limit itself not even the way to zero is safe
        self._frozen |= self._spread[0] * NANOMETRE > limits.shift
        if (
            2.0 * self._spread[0] * NANOMETRE > limits.shift
            or 2.0 * self._spread[1] * MICRODEGREE > limits.turn > 0.0
        ):
            self._refuse(
                f"answers without confirmation add up to {self._spread[0] * 1e-6:.3f} mm, more "
                f"than half of the limit of {limits.shift * 1e3:g} mm"
            )

    def _answer(self, moved: Steps, turned: Steps) -> Correction | None:
        if self.mode is CorrectionMode.RELATIVE:
            return correction_of(moved, turned, self.mode)
        if self._frozen:
            return None
        return correction_of(self._shift, self._turn, self.mode)

    def age(self, host_time: float) -> float:
        """Returns s since the measurement that the correction rests on; 0 where there is none.

        On its way to zero it rests on none.
        """
        wanted = self._wanted
        return 0.0 if wanted is None or not self.active else max(0.0, host_time - wanted[2])

    def count_late(self, answers: int, host_time: float) -> None:
        """Counts answers that arrived too late; too many within a period trip the watchdog."""
        with self._lock:
            self._late.extend([host_time] * min(answers, _HISTORY))
            recent = sum(host_time - at <= self.limits.late_window for at in self._late)
            if recent >= self.limits.late_answers:
                self._trip(f"{recent} late answers within {self.limits.late_window:g} s")

    def fault(self, why: str) -> None:
        """Trips the watchdog, for a reason that a link has seen."""
        with self._lock:
            self._trip(why)

    def note_restart(self, *, certain: bool = True) -> None:
        """Trips the watchdog because the controller has restarted, or may have.

        Args:
            certain: It has, and holds no correction. If not, it holds the correction of before or
                none: nothing can be sent that is safe in both cases, so the robot is not moved any
                more until the controller restarts for certain.
        """
        with self._lock:
            self._late.clear()
            if certain:
                self._shift, self._turn, self._pending = NONE, NONE, (NONE, NONE)
                self._spread = [0, 0]
                self._doubtful = self._frozen = self._refused = False
                self._trip("the controller has restarted")
                return
            state = self._state()
            if state.farthest == 0.0 and state.turn == NONE and state.spread[1] == 0:
                self._trip("the controller may have restarted")
                return
            self._frozen = True
            self._refuse(
                f"the controller may have restarted or still apply {state.farthest * 1e3:.3f} mm"
            )

    def release(self) -> None:
        """Goes to zero at the stated rate, for good."""
        with self._lock:
            self._released = True

    def rearm(self) -> None:
        """Lets corrections grow again after a trip, by the ramp, on the next valid estimate."""
        with self._lock:
            if self._refused:
                return
            self._tripped_at, self.why = None, ""
            self._wanted, self._started = None, math.nan
            self._late.clear()

    def state(self) -> GuardState:
        """Returns the state of the guard."""
        with self._lock:
            return self._state()

    def _state(self) -> GuardState:
        spread, turn_spread = self._spread
        return GuardState(
            shift=self._shift,
            turn=self._turn,
            trips=self.trips,
            why=self.why,
            active=self.active,
            pending=self._pending,
            spread=(spread, turn_spread),
            refused=self._refused,
            frozen=self._frozen,
        )

    def resume(self, state: GuardState, why: str) -> None:
        """Replaces a guard that has ended: ramps the correction that the robot holds to zero.

        Args:
            state: Of that guard, as it was last known.
            why: What ended it; a trip, unless it had tripped before.
        """
        with self._lock:
            self._shift, self._turn, self._pending = state.shift, state.turn, state.pending
            self._spread = list(state.spread)
            self._refused, self._frozen, self._doubtful = state.refused, state.frozen, True
            self.trips, self.why = state.trips + state.active, state.why
            if state.active:
                self.why = why
            self._tripped_at = -math.inf

    @property
    def at_rest(self) -> bool:
        """True if the robot holds no correction, apart from the spread."""
        open_value = self._doubtful and self.mode is CorrectionMode.ABSOLUTE
        return self._shift == self._turn == NONE and not self._frozen and not open_value

    @property
    def frozen(self) -> bool:
        """True if nothing is known well enough to move the robot."""
        return self._frozen

    @property
    def active(self) -> bool:
        """True if estimates are followed."""
        return self._tripped_at is None and not self._released

    def _find_elapsed(self, host_time: float) -> float:
        """Seconds this answer may move for: a cycle at most, none on a broken clock."""
        before = self._time
        if not math.isfinite(host_time) or host_time < before:
            self._trip("the computer's clock went back")
            self._time = host_time if math.isfinite(host_time) else before
            return 0.0
        self._time = host_time
        return (
            self.limits.cycle if math.isnan(before) else min(host_time - before, self.limits.cycle)
        )

    def _gain(self, host_time: float) -> float:
        """Share of the wanted correction that is aimed for, from 0 to 1."""
        wanted = self._wanted
        if wanted is None or self._released:
            return 0.0
        age = host_time - wanted[2]
        stale = not -_EARLY <= age <= self.limits.timeout
        if self._tripped_at is not None:
            waits = stale or wanted[2] <= self._tripped_at or not self.at_rest
            if self.limits.latch or self._refused or waits:
                return 0.0
            self._tripped_at, self.why, self._started = None, "", math.nan
        elif stale:
            lies = "ahead of" if age < 0.0 else "behind"
            self._trip(f"the estimate is {abs(age):.3f} s {lies} the answer")
            return 0.0
        if math.isnan(self._started):
            self._started = host_time
        if self.limits.ramp == 0.0:
            return 1.0
        return min(1.0, (host_time - self._started) / self.limits.ramp)

    def _trip(self, why: str) -> None:
        """Trips the watchdog: the correction ramps to zero. Does nothing before one is wanted."""
        if self._wanted is None and self.at_rest:
            return
        if self._tripped_at is None:
            self.trips += 1
            self.why = why
        self._tripped_at = -math.inf if math.isnan(self._time) else self._time

    def _refuse(self, why: str) -> None:
        """Trips permanently: only a certain restart of the controller ends it."""
        self.trips += self._tripped_at is None
        self._tripped_at = -math.inf if math.isnan(self._time) else self._time
        if not self._refused:
            self.why = f"{why}; no more corrections until the controller is restarted"
        self._refused = True


def _next_step(held: Steps, aim: Steps, most: float, farthest: float) -> Steps:
    """The step of one answer from what is held, for shift and turn alike."""
    return NONE if aim == held else step_toward(held, aim, most, farthest)


def check_whole(correction: Correction) -> None:
    """Checks that a correction is the whole of it.

    Raises:
        ModelMismatchError: It is meant as an increment.
    """
    if correction.mode is not CorrectionMode.ABSOLUTE:
        raise ModelMismatchError(
            "an increment as the wanted correction, expected the whole of it.",
            hint="CorrectionMode.ABSOLUTE; the guard makes the increments.",
        )
