"""Whether a predicted error keeps a tolerance, with the uncertainty counted against it.

Three answers::

    conforms   |e| + U <= T        fails   |e| - U > T        undecided   between

U is the radius that holds 95 % about the prediction, so the true error of a conforming target is
within T with at least 95 %. This is the guard band of ISO 14253-1 taken as a decision rule; each
target is judged by itself.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ConfigurationError


class Conformity(IntEnum):
    """What may be said of a target."""

    CONFORMS = 0
    UNDECIDED = 1
    FAILS = 2
    UNKNOWN = 3  # nothing was predicted


def conformity(length: Array, bound: Array, tolerance: float) -> IntArray:
    """Returns the :class:`Conformity` of each target, (n,).

    Args:
        length: (n,) m, predicted error; NaN where nothing was predicted.
        bound: (n,) m, radius that holds 95 % about it; NaN likewise.
        tolerance: m, largest distance from where the target should be.

    Raises:
        ConfigurationError: A tolerance that is not above zero.
    """
    if not 0.0 < tolerance < np.inf:
        raise ConfigurationError(
            f"tolerance {tolerance / 1e-3:g} mm, expected above 0.", hint="--tolerance-mm 0.2"
        )
    out = np.full(len(length), int(Conformity.UNDECIDED), dtype=np.int64)
    out[length + bound <= tolerance] = Conformity.CONFORMS
    out[length - bound > tolerance] = Conformity.FAILS
    out[~np.isfinite(length + bound)] = Conformity.UNKNOWN
    return out
