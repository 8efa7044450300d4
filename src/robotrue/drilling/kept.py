"""The kinds of documents a workspace keeps of drilling."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

CAMPAIGN: Final = "drilling campaign"
MODEL: Final = "drilling model"
TEST: Final = "drilling test"
JOURNAL: Final = "drilling journal"


def campaign_parts(files: Sequence[Path]) -> tuple[Path, Path | None]:
    """Returns the rows of a campaign and its foot file, which lies beside them if it is known."""
    feet = [path for path in files if len(files) > 1 and path.suffix.lower() == ".toml"]
    (rows,) = (path for path in files if path not in feet)
    return rows, feet[0] if feet else None
