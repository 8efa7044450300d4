"""Defaults of the mastering check, without the libraries that make one."""

from __future__ import annotations

from typing import Final

POSTURES: Final = 16
"""Planned touches of the point."""
TOOL_LEAN_DEG: Final = 60.0
"""Largest lean of the tool off straight down, in planned touches."""
POINT_SIGMA_MM: Final = 0.1
"""A point touched while the arm was good, per axis."""
