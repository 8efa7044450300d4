"""Defaults of a plan of poses, without the libraries that make one."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

Criterion: TypeAlias = Literal["I", "D"]
"""What a plan makes small: the variance where the arm will work, or that of its parameters."""
CRITERION: Final = "I"

POSES: Final = 30
"""A good model needs about as many."""
CANDIDATES: Final = 2000
"""Usable postures to choose from."""
SEED: Final = 1
"""Of the candidates, and of the random plans shown beside."""
