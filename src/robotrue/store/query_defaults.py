"""Defaults of listings of a workspace, without the libraries that make them."""

from __future__ import annotations

from typing import Final

LIMIT: Final = 50
"""Items of a listing that are shown."""
SORT: Final = "-created"
"""The newest first."""
SLOTS: Final = 1
"""Jobs that a worker does at a time."""
