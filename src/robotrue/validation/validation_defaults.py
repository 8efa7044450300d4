"""Defaults of the room, apart from the numeric libraries that its work needs."""

from __future__ import annotations

from typing import Final

# Drift checks
DRIFT_LEVEL: Final = 0.01
"""False-alarm rate of a check."""
FEWEST_DRIFT_POSES: Final = 4
"""Poses of a check; with fewer a moved base explains anything."""
DRIFT_POSES: Final = 7
"""Poses of a usual check."""

# Dry runs
DRY_RUN_POINTS: Final = 39
"""Along a program, as in Table 9 of Deng et al. 2022."""

# Evaluation of a hole
HOLE_CENTRE_MM: Final = "0,0"
PROBE_SIGMA_UM: Final = 10.0
"""Of one probed point along the wall's normal."""
WALL_MM: Final = 2.0
"""Distance from the nominal wall within which points of a scan belong to it."""

# Maps of the error
MAP_ATTITUDE: Final = "turning"
"""With the angle about joint 1."""
MAP_SECTORS: Final = 4
"""Parts of a region that are compared."""

# Mastering checks
MASTERING_TOUCHES: Final = 16
"""Planned touches of the point."""
TOOL_LEAN_DEG: Final = 60.0
"""Largest lean of the tool off straight down, in planned touches."""
POINT_SIGMA_MM: Final = 0.1
"""A point touched while the arm was good, per axis."""

# Registration
TOUCH_MM: Final = 0.1
"""One touch, per axis: a tip or ball by hand or by a trigger."""
REGISTRATION_FIT: Final = "auto"
"""The touches update the arm where they determine enough of it."""
REGISTRATION_METHOD: Final = "touches"
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

# Comparisons of regions
SIMILARITY_REGIONS: Final = 4
"""Regions the measured points are divided into where none is stated: a reference and three more."""
APART_MM: Final = 50.0
"""Distance within which two points of two regions correspond."""
FEWEST_PAIRS: Final = 5
"""Corresponding points from which a similarity is stated."""
