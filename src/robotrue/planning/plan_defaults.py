"""Defaults of plans of poses, touches and machining, without the libraries that make them."""

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
"""Of the candidates, and of the random plans for comparison."""
GOAL: Final = "mean"
"""Touches serve the rms over the machined points, not the worst of them."""
LEAN_DEG: Final = 15.0
"""By which touches lean off the machined attitudes."""
LIFT_MM: Final = 100.0
"""Over part and paths before and after each side."""
TIP_AXIS: Final = "+z"
"""The way from the flange to the tip, in the tool frame."""
ROUGH_MM: Final = 20.0
"""Standard deviation of a part's stated rough position."""
STOCK_MM: Final = 1.0
"""What a roughing pass leaves along the tool axis."""

PlanMethod: TypeAlias = Literal["information", "hierarchical"]
INFORMATION: Final[PlanMethod] = "information"
"""Number of most informative poses."""
HIERARCHICAL: Final[PlanMethod] = "hierarchical"
"""Samples a source completely and its images in sub-spaces."""
SUB_SPACES: Final = 5
"""Of the paper's target domain (Tables 6 and 7 of Deng et al. 2022), as those below."""
SOURCE_GRID: Final = "3,7,6"
TURNS_DEG: Final = "-15..15/15,-10..10/5,-10..10/2.5"
TARGET_POSES: Final = 80
TOOL_ABC_DEG: Final = "0,180,0"
"""The measured point's z axis points down."""
