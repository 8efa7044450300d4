"""Detects an implausible force from its numbers alone: counts, flat tops, a dead cable.

The same tests as of recorded forces (:func:`robotrue.dynamics.force.check_force`), one sample at a
time. They need a few samples to see it; at the start these fall into the time the filters settle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Records
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.online.sensing_records import new_record, record_dtype

_WHOLE: Final = 8
_COUNTS: Final = 1000.0
"""Whole numbers in all three channels, so many in a row, and some beyond this: counts."""
_STILL: Final = 200
"""Samples in a row without any change in any channel: no sensor is connected."""
_FLAT: Final = 4
_HIGH: Final = 20.0
"""N; a channel that stays at its extreme for that many samples, twice, beyond this is clipped."""
WATCH_DTYPE: Final = record_dtype(
    ("last", (3,)), ("whole_run", ()), ("whole_largest", ()), ("equal_run", ()),
    ("channels", (3, 5)),
)  # fmt: skip
"""Force watch: last force N; run of whole numbers and its largest size; run of equal samples; for
each axis the columns below."""
HIGHEST, TIMES_HIGHEST, LOWEST, TIMES_LOWEST, RUN = range(5)
"""Extreme values of an axis, how often it was flat there, and its run at one value."""


def new_watch() -> Records:
    """Returns the state of a watch that has seen nothing."""
    watch = new_record(WATCH_DTYPE)
    watch["last"] = np.nan
    watch["channels"][0, :, HIGHEST], watch["channels"][0, :, LOWEST] = -np.inf, np.inf
    return watch


@compile_kernel(EXACT)
def refuse_force(wrench: Array, largest: float, watch: np.record) -> bool:
    """Returns whether a sample is not to be used; ``watch`` is changed."""
    bad, whole, size, still = False, True, 0.0, True
    for c in range(3):
        f = wrench[c]
        if not abs(f) < largest:  # NaN too
            bad = True
        whole = whole and f == np.rint(f)
        size = max(size, abs(f))
        still = still and f == watch.last[c]
    if bad:
        return True
    watch.whole_run = watch.whole_run + 1.0 if whole else 0.0
    watch.whole_largest = max(watch.whole_largest, size) if whole else 0.0
    watch.equal_run = watch.equal_run + 1.0 if still else 0.0
    for c in range(3):
        f, channel = wrench[c], watch.channels[c]
        channel[RUN] = channel[RUN] + 1.0 if f == watch.last[c] else 0.0
        watch.last[c] = f
        for extreme in (HIGHEST, LOWEST):
            beyond = f > channel[extreme] if extreme == HIGHEST else f < channel[extreme]
            if beyond:
                channel[extreme], channel[extreme + 1] = f, 0.0
            elif f == channel[extreme] and abs(f) >= _HIGH:
                if channel[RUN] == _FLAT - 1.0:
                    channel[extreme + 1] += 1.0
                bad = bad or channel[extreme + 1] >= 2.0
    counts = watch.whole_run >= _WHOLE and watch.whole_largest > _COUNTS
    return bool(bad or counts or watch.equal_run >= _STILL)
