"""A force that cannot be right, seen from its numbers alone: counts, flat tops, a dead cable.

The same tests as of recorded forces (:func:`robotrue.dynamics.force.check_force`), one sample at a
time. They need a few samples to see it; at the start these fall into the time the filters settle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compiled

SIZE: Final = 21
"""Last force x y z; run of whole numbers, its largest size; run of equal samples; then for each
axis: highest value, how often it was flat there, lowest value, how often, run at one value."""
_WHOLE: Final = 8
_COUNTS: Final = 1000.0
"""Whole numbers in all three channels, so many in a row, and some beyond this: counts."""
_STILL: Final = 200
"""Samples in a row without the least change in any channel: nobody is connected."""
_FLAT: Final = 4
_HIGH: Final = 20.0
"""N; a channel that stands at its extreme for so many samples, twice, beyond this: clipped."""


def fresh() -> Array:
    """Returns the state of a watch that has seen nothing."""
    state = np.zeros(SIZE)
    state[:3] = np.nan
    for c in range(3):
        state[6 + 5 * c], state[8 + 5 * c] = -np.inf, np.inf
    return state


@compiled(EXACT)
def watched(wrench: Array, most: float, w: Array) -> bool:
    """Returns whether a sample is not to be used; ``w`` is the state of the watch, changed."""
    bad, whole, size, still = False, True, 0.0, True
    for c in range(3):
        f = wrench[c]
        if not abs(f) < most:  # NaN too
            bad = True
        whole = whole and f == np.rint(f)
        size = max(size, abs(f))
        still = still and f == w[c]
    if bad:
        return True
    w[3] = w[3] + 1.0 if whole else 0.0
    w[4] = max(w[4], size) if whole else 0.0
    w[5] = w[5] + 1.0 if still else 0.0
    for c in range(3):
        f, at = wrench[c], 6 + 5 * c
        w[at + 4] = w[at + 4] + 1.0 if f == w[c] else 0.0
        w[c] = f
        for k in range(2):
            place = at + 2 * k
            if (f > w[place]) if k == 0 else (f < w[place]):
                w[place], w[place + 1] = f, 0.0
            elif f == w[place] and abs(f) >= _HIGH:
                if w[at + 4] == _FLAT - 1.0:
                    w[place + 1] += 1.0
                bad = bad or w[place + 1] >= 2.0
    return bool(bad or (w[3] >= _WHOLE and w[4] > _COUNTS) or w[5] >= _STILL)
