"""The process force where the robot carries the part: it acts at the tool in the cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arrays import Array
from robotrue.program.program import Program
from robotrue.robot.statics import Load


def at_part(program: Program, load: Load) -> Load:
    """Returns the load with the wrench on a held part moved from the tool to the part's frame.

    The wrench of such a target is what the tool does to the part, at the tool point; the frame the
    robot moves is the part's, so that the moment about its origin is m + (p_tool - p_part) x f.

    Args:
        program: Targets; those that are not held keep their wrench.
        load: One row, or one per target.
    """
    if not program.held.any() or not load.wrench.any():
        return load
    wrench = np.array(np.broadcast_to(load.wrench, (len(program), 6)))
    rows = np.flatnonzero(program.held & np.isfinite(program.position).all(axis=1))
    R_base_tool = program.T_base_frame[program.frame[rows], :3, :3]
    lever: Array = -np.einsum("nij,nj->ni", R_base_tool, program.position[rows])
    wrench[rows, 3:] += np.cross(lever, wrench[rows, :3])
    return replace(load, wrench=wrench)
