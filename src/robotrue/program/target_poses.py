"""Where the targets of a program are in the robot's base."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.program.program import Program


def target_poses(program: Program) -> Array:
    """Returns T_base_tool (n, 4, 4) of every target; NaN without a pose or a known frame."""
    frame = program.frame
    known = (frame >= 0) & (frame < len(program.T_base_frame))
    out = np.full((len(program), 4, 4), np.nan)
    T_frame_tool = pose(program.rotation[known], program.position[known])
    out[known] = program.T_base_frame[frame[known]] @ T_frame_tool
    return out
