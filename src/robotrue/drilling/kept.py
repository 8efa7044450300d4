"""The kinds of documents a workspace keeps of drilling."""

from __future__ import annotations

from typing import Final

CAMPAIGN: Final = "drilling campaign"
MODEL: Final = "drilling model"
TEST: Final = "drilling test"
JOURNAL: Final = "drilling journal"
