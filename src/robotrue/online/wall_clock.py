"""The host's monotonic clock as the time of day, for those who read from elsewhere."""

from __future__ import annotations

import time
from typing import Final

LIVE: Final = 60.0
"""s; a sample older than this, or from later than now, is a replay and not live."""


def utc_seconds(host_time: float) -> float:
    """Returns s since 1970 in UTC at which the monotonic clock stood at ``host_time``.

    A replay has its own clock; what it gives now is stamped with now.
    """
    age = time.monotonic() - host_time
    return time.time() - (age if 0.0 <= age <= LIVE else 0.0)
