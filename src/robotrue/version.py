"""The version of the package; a leaf, so that every room may state it."""

from __future__ import annotations

__version__ = "0.1.0"
