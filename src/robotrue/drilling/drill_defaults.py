"""Choices of drilling with their defaults, and its documents in a workspace.

Imports no numeric library: commands and pages read it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal, TypeAlias

Kind: TypeAlias = Literal["patent", "interactions", "quadratic", "cubic", "gp", "physics"]
"""Corrections of readings, from the simplest to the richest."""
Corrects: TypeAlias = Literal["readings", "joints"]
"""What a correction is subtracted from: the readings, or the targets of A and B."""
CORRECTS: Final[Corrects] = "readings"
Position: TypeAlias = Literal["X", "Y", "A", "B"]
"""Machine positions that may be causes of a reading error besides tilt, force and height."""
Inputs: TypeAlias = Literal["auto", "none", "AB", "XY", "XYAB"]
"""Which of them a fit uses; auto: those that win on held-out blocks."""
MACHINE_INPUTS: Final[Inputs] = "auto"
By: TypeAlias = Literal["information", "chance"]
"""How the clamps of a campaign are chosen."""
CHOSEN_BY: Final = "information"
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
CAMPAIGN: Final = "drilling campaign"
MODEL: Final = "drilling model"
TEST: Final = "drilling test"
JOURNAL: Final = "drilling journal"


def campaign_parts(files: Sequence[Path]) -> tuple[Path, Path | None]:
    """Returns the rows of a campaign and its foot file, which lies next to them if it is known."""
    feet = [path for path in files if len(files) > 1 and path.suffix.lower() == ".toml"]
    (rows,) = (path for path in files if path not in feet)
    return rows, feet[0] if feet else None
