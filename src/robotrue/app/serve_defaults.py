"""Default address of the workbench, and the limit of what its pages compute at once."""

from __future__ import annotations

from typing import Final

HOST: Final = "127.0.0.1"
"""This computer alone."""
PORT: Final = 8080
LARGEST_DRAWN: Final = 30_000_000
"""Largest program, in bytes, that a page checks, draws or compares while the user waits."""
