"""Defaults of comparisons of regions, without the libraries that make one."""

from __future__ import annotations

from typing import Final

DIVIDE: Final = 4
"""Regions the measured points are divided into where none is stated: a reference and three more."""
APART_MM: Final = 50.0
"""Distance within which two points of two regions correspond."""
FEWEST_PAIRS: Final = 5
"""Corresponding points from which a similarity is stated."""
