"""Default address of the workbench."""

from __future__ import annotations

from typing import Final

HOST: Final = "127.0.0.1"
"""This computer alone."""
PORT: Final = 8080
