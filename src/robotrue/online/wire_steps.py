"""Corrections in whole steps of the wire, 1 nm and 1e-6 deg, so that what was sent adds up."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG
from robotrue.online.samples import Correction, CorrectionMode

Steps = tuple[int, int, int]
NANOMETRE: Final = 1e-9
MICRODEGREE: Final = 1e-6 * DEG
NONE: Final[Steps] = (0, 0, 0)
_FUZZ: Final = 1e-6
"""Of a step; what division leaves of a whole number."""
_INSIDE: Final = 10
"""Steps inside the limit that are aimed for, so that steps made whole stay within."""
_ZEROS: Final[Array] = frozen(np.zeros(3), (3,), "zeros")


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
    """Whole steps in SI; not to be written to, so that nobody copies it."""
    if steps == NONE:
        return _ZEROS
    vector = np.array([step * unit for step in steps])
    vector.flags.writeable = False
    return vector


_REST: Final = {m: Correction(shift=_ZEROS, turn=_ZEROS, mode=m) for m in CorrectionMode}
"""Answers that move nothing, which most of them are; nobody can write to them."""
