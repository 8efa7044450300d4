"""Default limits of compensation, without the libraries that perform it."""

from __future__ import annotations

from typing import Final

MAX_SHIFT_MM: Final = 10.0
"""Largest correction of a target."""
MAX_STEP_MM: Final = 0.1
"""Largest step between a target left alone and its compensated neighbours."""
SPLIT_LIMIT: Final = 100_000
"""Largest number of targets inserted between those of a program."""
BLEND_MM: Final = 0.2
"""``$APO.CDIS`` of programs that are made of tool paths."""
