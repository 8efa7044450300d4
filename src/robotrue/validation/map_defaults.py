"""Defaults of a map of the error, without the libraries that make one."""

from __future__ import annotations

from typing import Final

ATTITUDE: Final = "turning"
"""With the angle about joint 1."""
SECTORS: Final = 4
"""Parts of a region that are compared."""
