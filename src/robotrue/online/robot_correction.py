"""A correction as a controller takes it: in SI, and in whole steps of the wire.

A step is 1 nm or 1e-6 deg, so that what was sent adds up.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG

Steps = tuple[int, int, int]
NANOMETRE: Final = 1e-9
MICRODEGREE: Final = 1e-6 * DEG
NONE: Final[Steps] = (0, 0, 0)
_FUZZ: Final = 1e-6
"""Of a step; what division leaves of a whole number."""
_INSIDE: Final = 10
"""Steps inside the limit that are aimed for, so that steps made whole stay within."""
_ZEROS: Final[Array] = frozen(np.zeros(3), (3,), "zeros")


class CorrectionMode(enum.Enum):
    """Interpretation of a correction by the controller; the wrong one is dangerous."""

    RELATIVE = "relative"
    """Added in every cycle: the same value sent twice moves twice as far."""
    ABSOLUTE = "absolute"
    """Against the programmed path: the same value sent twice changes nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """Displacement of the robot from its programmed path.

    Attributes:
        shift: (3,) m in the frame of the controller's correction.
        turn: (3,) rad, rotation vector in the same frame.
        mode: Whether the controller adds it up in every cycle; there is no default.
    """

    shift: Array
    turn: Array
    mode: CorrectionMode

    def __post_init__(self) -> None:
        """Freezes and checks; a correction that is not finite never reaches a robot."""
        if not _is_settled(self.shift):
            object.__setattr__(self, "shift", frozen(self.shift, (3,), "shift"))
        if not _is_settled(self.turn):
            object.__setattr__(self, "turn", frozen(self.turn, (3,), "turn"))


def _is_settled(vector: Array) -> bool:
    """True if ``frozen`` would return the array unchanged; fast, because a controller waits."""
    return (
        isinstance(vector, np.ndarray)
        and not vector.flags.writeable
        and vector.shape == (3,)
        and vector.dtype == np.float64
        and math.isfinite(sum(vector.tolist()))
    )


def no_correction(mode: CorrectionMode) -> Correction:
    """Returns the correction that leaves the robot on its path (absolute) or where it is."""
    return Correction(shift=np.zeros(3), turn=np.zeros(3), mode=mode)


def steps_within(vector: list[float], limit: float, unit: float) -> Steps:
    """Returns the vector in whole steps, cut to its limit along itself."""
    most = max(0.0, limit - _INSIDE * unit)
    largest = max(abs(v) for v in vector)
    if largest == 0.0:
        return NONE
    # by its largest: the square of what no robot can do need not be finite
    way = [v / largest for v in vector]
    length = math.hypot(*way)
    size = min(largest, most / length) / unit
    x, y, z = (int(v * size) for v in way)
    return x, y, z


def step_toward(now: Steps, target: Steps, most: float, limit: float) -> Steps:
    """Returns the step towards the target, no longer than most, that stays within the limit.

    Beyond a limit that has shrunk it goes straight to zero: of all ways this is the one on which
    no place within the spread gets farther than it may be already.
    """
    if target != NONE:
        if math.hypot(*now) > limit:
            target = NONE
        elif (far := math.hypot(*target)) > limit:
            target = steps_scaled(target, max(0.0, limit - _INSIDE) / far)
    way = steps_sum(target, now, -1)
    length = math.hypot(*way)
    if length == 0.0:
        return NONE  # the target was beyond a limit that has shrunk
    share = min(1.0, most / length)
    x, y, z = (int(v * share + math.copysign(_FUZZ, v)) for v in way)
    step: Steps = (x, y, z)
    if math.hypot(*steps_sum(now, step)) > max(limit, math.hypot(*now)):
        return NONE
    return step


def steps_sum(a: Steps, b: Steps, sign: int = 1) -> Steps:
    """Returns the sum, or with a sign of -1 the difference."""
    return a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]


def steps_scaled(steps: Steps, gain: float) -> Steps:
    """Returns steps times a gain, made whole towards zero."""
    x, y, z = (int(v * gain) for v in steps)
    return x, y, z


def correction_of(shift: Steps, turn: Steps, mode: CorrectionMode) -> Correction:
    """Returns steps as a correction in SI."""
    if shift == turn == NONE:
        return _REST[mode]
    return Correction(shift=_vector(shift, NANOMETRE), turn=_vector(turn, MICRODEGREE), mode=mode)


def _vector(steps: Steps, unit: float) -> Array:
    """Converts whole steps to SI; read-only, so callers need not copy it."""
    if steps == NONE:
        return _ZEROS
    vector = np.array([step * unit for step in steps])
    vector.flags.writeable = False
    return vector


_REST: Final = {m: Correction(shift=_ZEROS, turn=_ZEROS, mode=m) for m in CorrectionMode}
"""Read-only answers that move nothing, which most of them are."""
