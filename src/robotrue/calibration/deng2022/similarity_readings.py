"""Readings of eq. 9-10, without the libraries that compute them; see ``similarity``."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias, get_args

SimilarityReading: TypeAlias = Literal[
    "per-point", "swapped", "shared", "per-axis", "raw", "coordinates"
]
READINGS: Final[tuple[SimilarityReading, ...]] = get_args(SimilarityReading)
READING: Final[SimilarityReading] = "per-point"
"""Closest to the paper's Table 4."""
