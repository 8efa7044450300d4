"""What users choose of drilling and what it is unless they say so, without numeric libraries."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

Kind: TypeAlias = Literal["patent", "interactions", "quadratic", "cubic", "gp", "physics"]
"""Corrections of readings, from the simplest to the richest."""
By: TypeAlias = Literal["information", "chance"]
"""How the clamps of a campaign are chosen."""
LIMIT_DEG: Final = 0.1
"""95 % of the tilts left are to be within."""
REFERENCE_SIGMA_DEG: Final = 0.005
"""Standard deviation of a reference that measures what was left."""
FOOT_ABC_DEG: Final = "0,0,180"
"""A, B, C of the foot in the tool of a robot: z against z."""
CLAMP_FORCE_N: Final = 50.0
"""Above it the foot is clamped."""
RELEASED: Final = 0.4
"""Part of that force below which a clamp has ended."""
QUIET_MS: Final = 200.0
"""In it nothing may move."""
STEADY_UM: Final = 20.0
STEADY_N: Final = 10.0
"""What readings and force may move by in that time."""
PATIENCE_S: Final = 5.0
"""Then a clamp that does not come to rest is given up."""
PORT: Final = 47600
"""UDP, on which the machine's values come in."""
