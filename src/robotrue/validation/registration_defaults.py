"""Defaults of a registration, without the libraries that make one."""

from __future__ import annotations

from typing import Final

TOUCH_MM: Final = 0.1
"""One touch, per axis: a tip or ball by hand or by a trigger."""
FIT: Final = "auto"
"""The touches move the arm where they tell enough of it."""
METHOD: Final = "touches"
"""Every touch counts, and wrong ones are named."""
FRAME_NUMBER: Final = 1
"""First entry of a controller's frame table."""
TOOL_NUMBER: Final = 1
"""First entry of a controller's tool table that is free."""
SQUARE_DEG: Final = 0.05
"""One squaring of a tool on a plane, per axis: a 20 mm square held against the shank by eye."""
LEFT_OVER_MM: Final = 1.0
"""What a blank must leave over the part: a roughing cut's scallops and a touch of the saw."""
PROBE_RADIUS_MM: Final = 0.0
"""A tip, not a ball."""
MESH_UNIT: Final = "mm"
"""What CAD systems write STL in."""
