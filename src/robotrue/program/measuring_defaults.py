"""Defaults of measuring programs, without the libraries that write one."""

from __future__ import annotations

from typing import Final

TRIGGER_OUTPUT: Final = 17
"""Digital output that triggers the instrument."""
