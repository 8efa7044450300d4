"""Rules for target poses, without the libraries that apply them; see ``sampling``."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias, get_args

TargetRule: TypeAlias = Literal["random", "boundary", "corners", "space-filling"]
"""Rule 3 and what may stand in its place."""
RULES: Final[tuple[TargetRule, ...]] = get_args(TargetRule)
TARGET_RULE: Final[TargetRule] = "random"
