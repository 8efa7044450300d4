"""Defaults of the evaluation of a hole; imports no numeric library."""

from typing import Final

CENTRE_MM: Final = "0,0"
PROBE_SIGMA_UM: Final = 10.0
"""Of one probed point along the wall's normal."""
WALL_MM: Final = 2.0
"""Distance from the nominal wall within which points of a scan belong to it."""
