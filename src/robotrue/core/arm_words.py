"""Configuration words: data on the arm in a controller's target, besides the pose of its tool.

Every maker has its own words; here they are columns of integers in the order they are written:

=========  ======  =============================================================================
maker      number  columns
=========  ======  =============================================================================
kuka       2       S, T
abb        4       cf1, cf4, cf6, cfx
fanuc      6       1 for F, 1 for U, 1 for T, then the turns of J4, J5, J6
yaskawa    6       first six fields of RCONF: no flip, lower, rear, R, T, S beyond 180 deg
=========  ======  =============================================================================
"""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

Maker: TypeAlias = Literal["", "kuka", "abb", "fanuc", "yaskawa"]
"""Whose words; empty where a language has none."""
NO_WORD: Final = -(2**31)
"""A word that is not written; in a replacement, one that stays as it is."""
WORDS: Final[dict[str, int]] = {"": 0, "kuka": 2, "abb": 4, "fanuc": 6, "yaskawa": 6}
"""Number of columns."""
