"""Defaults of drift checks, without the libraries that make one."""

from __future__ import annotations

from typing import Final

LEVEL: Final = 0.01
"""False-alarm rate of a check."""
FEWEST: Final = 4
"""Poses of a check; with fewer a moved base explains anything."""
POSES: Final = 7
"""Poses of a usual check."""
