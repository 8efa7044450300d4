"""What stands between an estimate and a moving robot: limits, rates, a ramp and a watchdog.

The correction that the robot holds is kept in whole steps of the wire (1 nm, 1e-6 deg), so that
what was sent adds up to what is held for as long as the service runs. Each answer may change it by
the rate times one cycle at most, however long the computer slept before.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.samples import Correction, CorrectionMode

_NANOMETRE: Final = 1e-9
_MICRODEGREE: Final = 1e-6 * DEG
_FUZZ: Final = 1e-6
"""Of a step; what division leaves of a whole number."""
_INSIDE: Final = 10
"""Steps inside the limit that are aimed for, so that steps made whole stay within."""
_EARLY: Final = 1e-3
"""s by which a measurement may lie ahead of the answer: two threads read one clock."""
_HISTORY: Final = 1000
_WIDEST_TURN: Final = 5.0 * DEG
"""Turns are added up as vectors, which holds for small ones."""

_Steps = tuple[int, int, int]
_NONE: Final[_Steps] = (0, 0, 0)
_ZEROS: Final[Array] = frozen(np.zeros(3), (3,), "zeros")


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionLimits:
    """What a correction may never exceed.

    Attributes:
        shift: m, its largest length.
        shift_rate: m/s, its fastest change.
        cycle: s for which one answer stands at most (RSI 4 or 12 ms).
        turn: rad; 0 never turns the tool.
        turn_rate: rad/s.
        timeout: s after which an estimate is too old.
        ramp: s in which a correction grows to its full size after the start.
        late_answers: That many late answers within ``late_window`` make the watchdog bite.
        late_window: s.
        latch: After a bite it stays at zero until it is armed again.
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
    """How a guard stands, in whole steps of the wire.

    Attributes:
        shift: nm that the robot holds.
        turn: 1e-6 deg that it holds.
        bites: How often the watchdog has bitten.
        why: For the last time, or empty.
        active: Whether estimates are followed.
    """

    shift: tuple[int, int, int] = (0, 0, 0)
    turn: tuple[int, int, int] = (0, 0, 0)
    bites: int = 0
    why: str = ""
    active: bool = True

    @property
    def at_rest(self) -> bool:
        """Whether the robot holds no correction."""
        return self.shift == _NONE and self.turn == _NONE

    @property
    def held(self) -> Correction:
        """The whole correction that the robot holds."""
        return _correction(self.shift, self.turn, CorrectionMode.ABSOLUTE)


class CorrectionGuard:
    """A :class:`~robotrue.online.link.Corrector` that keeps within its limits whatever is wanted.

    It starts at zero, and goes back there at the stated rate, without a jump, when the estimate
    is invalid or older than ``timeout``, when answers come late, or when a link sees a fault.
    ``why`` tells. With ``latch`` it stays there until :meth:`rearm`.

    Args:
        limits: What it keeps to.
        mode: What the controller does with an answer; for RELATIVE the answers are increments.
    """

    def __init__(self, limits: CorrectionLimits, mode: CorrectionMode) -> None:
        self.limits, self.mode = limits, mode
        self.why = ""
        self.bites = 0
        self._lock = threading.Lock()
        self._shift: _Steps = _NONE
        self._turn: _Steps = _NONE
        self._wanted: tuple[_Steps, _Steps, float] | None = None
        self._sent: deque[tuple[_Steps, _Steps]] = deque(maxlen=_HISTORY)
        self._late: deque[float] = deque(maxlen=_HISTORY)
        self._time = math.nan
        self._started = math.nan
        self._bitten_at: float | None = None
        self._released = False

    def want(self, correction: Correction, host_time: float) -> None:
        """Takes a correction to be reached: the whole of it, whatever the controller adds up.

        Args:
            correction: In ABSOLUTE terms; beyond the limits it is cut to them.
            host_time: s on the monotonic clock of the measurement it rests on.

        Raises:
            ModelMismatchError: It is meant as an increment.
        """
        check_whole(correction)
        shift = _within(correction.shift.tolist(), self.limits.shift, _NANOMETRE)
        turn = _within(correction.turn.tolist(), self.limits.turn, _MICRODEGREE)
        with self._lock:
            if not math.isfinite(host_time):
                self._bite("an estimate without a time")
            elif self._wanted is None or host_time >= self._wanted[2]:
                self._wanted = (shift, turn, host_time)

    def doubt(self, why: str) -> None:
        """Takes note that the estimate is invalid."""
        self.fault(why)

    def next(self, host_time: float) -> Correction:
        """Returns the correction to send now, which is finite and within the limits.

        Args:
            host_time: s on the monotonic clock.
        """
        with self._lock:
            elapsed = self._elapsed(host_time)
            gain = self._gain(host_time)
            shift, turn = _NONE, _NONE
            if gain > 0.0 and self._wanted is not None:
                shift, turn = _scaled(self._wanted[0], gain), _scaled(self._wanted[1], gain)
            limits = self.limits
            moved = _toward(
                self._shift,
                shift,
                limits.shift_rate * elapsed / _NANOMETRE,
                limits.shift / _NANOMETRE,
            )
            turned = _toward(
                self._turn,
                turn,
                limits.turn_rate * elapsed / _MICRODEGREE,
                limits.turn / _MICRODEGREE,
            )
            self._shift, self._turn = _sum(self._shift, moved), _sum(self._turn, turned)
            self._sent.append((moved, turned))
            if self.mode is CorrectionMode.RELATIVE:
                return _correction(moved, turned, self.mode)
            return _correction(self._shift, self._turn, self.mode)

    def age(self, host_time: float) -> float:
        """Returns s since the measurement that the correction rests on; 0 where there is none.

        On its way to zero it rests on none.
        """
        wanted = self._wanted
        return 0.0 if wanted is None or not self.active else max(0.0, host_time - wanted[2])

    def missed(self, answers: int, host_time: float) -> None:
        """Takes note of answers before the latest one that were not taken.

        Increments among them were never made. Answers are counted as missed once.
        """
        with self._lock:
            if self.mode is CorrectionMode.RELATIVE and self._sent:
                latest = self._sent.pop()
                for _ in range(min(answers, len(self._sent))):
                    moved, turned = self._sent.pop()
                    self._shift, self._turn = (
                        _sum(self._shift, moved, -1),
                        _sum(self._turn, turned, -1),
                    )
                self._sent.append(latest)
            self._late.extend([host_time] * min(answers, _HISTORY))
            recent = sum(host_time - at <= self.limits.late_window for at in self._late)
            if recent >= self.limits.late_answers:
                self._bite(f"{recent} late answers within {self.limits.late_window:g} s")

    def fault(self, why: str) -> None:
        """Bites, for a reason that a link has seen."""
        with self._lock:
            self._bite(why)

    def restarted(self) -> None:
        """Begins at zero, as the controller does, and bites."""
        with self._lock:
            self._shift, self._turn = _NONE, _NONE
            self._sent.clear()
            self._late.clear()
            self._bite("the controller has begun anew")

    def release(self) -> None:
        """Goes to zero at the stated rate, for good."""
        with self._lock:
            self._released = True

    def rearm(self) -> None:
        """Lets corrections grow again after a bite, by the ramp, on the next valid estimate."""
        with self._lock:
            self._bitten_at, self.why = None, ""
            self._wanted, self._started = None, math.nan
            self._late.clear()

    def state(self) -> GuardState:
        """Returns how it stands."""
        with self._lock:
            return GuardState(
                shift=self._shift,
                turn=self._turn,
                bites=self.bites,
                why=self.why,
                active=self.active,
            )

    def resume(self, state: GuardState, why: str) -> None:
        """Goes on for a guard that has ended: from what the robot holds back to zero.

        Args:
            state: Of that guard, as it was last known.
            why: What ended it; a bite, unless it had bitten before.
        """
        with self._lock:
            self._shift, self._turn = state.shift, state.turn
            self.bites, self.why = state.bites + state.active, state.why
            if state.active:
                self.why = why
            self._bitten_at = -math.inf

    @property
    def at_rest(self) -> bool:
        """Whether the robot holds no correction."""
        return self._shift == _NONE and self._turn == _NONE

    @property
    def active(self) -> bool:
        """Whether estimates are followed."""
        return self._bitten_at is None and not self._released

    @property
    def held(self) -> Correction:
        """The whole correction that the robot holds, as far as its controller has told."""
        return _correction(self._shift, self._turn, CorrectionMode.ABSOLUTE)

    def _elapsed(self, host_time: float) -> float:
        """Seconds this answer may move for: a cycle at most, none on a broken clock."""
        before = self._time
        if not math.isfinite(host_time) or host_time < before:
            self._bite("the computer's clock went back")
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
        if self._bitten_at is not None:
            if self.limits.latch or stale or wanted[2] <= self._bitten_at or not self.at_rest:
                return 0.0
            self._bitten_at, self.why, self._started = None, "", math.nan
        elif stale:
            lies = "ahead of" if age < 0.0 else "behind"
            self._bite(f"the estimate is {abs(age):.3f} s {lies} the answer")
            return 0.0
        if math.isnan(self._started):
            self._started = host_time
        if self.limits.ramp == 0.0:
            return 1.0
        return min(1.0, (host_time - self._started) / self.limits.ramp)

    def _bite(self, why: str) -> None:
        """Goes to zero from here on; nothing to bite before something is wanted."""
        if self._wanted is None and self.at_rest:
            return
        if self._bitten_at is None:
            self.bites += 1
            self.why = why
        self._bitten_at = -math.inf if math.isnan(self._time) else self._time


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


def _within(vector: list[float], limit: float, unit: float) -> _Steps:
    """The vector in whole steps, cut to its limit along itself."""
    most = max(0.0, limit - _INSIDE * unit)
    largest = max(abs(v) for v in vector)
    if largest == 0.0:
        return _NONE
    # by its largest: the square of what no robot can do need not be finite
    way = [v / largest for v in vector]
    length = math.hypot(*way)
    size = min(largest, most / length) / unit
    x, y, z = (int(v * size) for v in way)
    return x, y, z


def _toward(now: _Steps, target: _Steps, most: float, limit: float) -> _Steps:
    """The step from now towards the target, no longer than most, that does not leave the limit."""
    way = _sum(target, now, -1)
    length = math.hypot(*way)
    if length == 0.0:
        return _NONE
    share = min(1.0, most / length)
    x, y, z = (int(v * share + math.copysign(_FUZZ, v)) for v in way)
    step: _Steps = (x, y, z)
    if math.hypot(*_sum(now, step)) > max(limit, math.hypot(*now)):
        return _NONE
    return step


def _sum(a: _Steps, b: _Steps, sign: int = 1) -> _Steps:
    return a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]


def _scaled(steps: _Steps, gain: float) -> _Steps:
    x, y, z = (int(v * gain) for v in steps)
    return x, y, z


def _correction(shift: _Steps, turn: _Steps, mode: CorrectionMode) -> Correction:
    return Correction(shift=_vector(shift, _NANOMETRE), turn=_vector(turn, _MICRODEGREE), mode=mode)


def _vector(steps: _Steps, unit: float) -> Array:
    """Whole steps in SI; not to be written to, so that nobody copies it."""
    if steps == _NONE:
        return _ZEROS
    vector = np.array([step * unit for step in steps])
    vector.flags.writeable = False
    return vector
