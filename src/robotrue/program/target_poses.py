"""Poses of a program's targets in the robot base, also of a part that the robot holds.

The target of a part that the robot carries to a tool fixed in the cell is printed as the tool in
the part frame; the robot moves the part. Internally it is the part frame in that tool: the moving
frame in a fixed one. Code between reader and writer needs no special case.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import pose
from robotrue.program.program import Program, Replacement


def target_poses(program: Program) -> Array:
    """Returns T_base_tool (n, 4, 4) of every target; NaN without a pose or a known frame."""
    frame = program.frame
    known = (frame >= 0) & (frame < len(program.T_base_frame))
    out = np.full((len(program), 4, 4), np.nan)
    T_frame_tool = pose(program.rotation[known], program.position[known])
    out[known] = program.T_base_frame[frame[known]] @ T_frame_tool
    return out


def turned_round(position: Array, rotation: Array, held: BoolArray) -> tuple[Array, Array]:
    """Returns position (n, 3) and rotation (n, 3, 3) with the poses of held rows inverted."""
    if not held.any():
        return position, rotation
    position, rotation = np.array(position), np.array(rotation)
    back = np.swapaxes(rotation[held], 1, 2)
    position[held] = -np.einsum("nij,nj->ni", back, position[held])
    rotation[held] = back
    return position, rotation


def as_printed(program: Program, replacement: Replacement) -> tuple[Program, Replacement]:
    """Returns both with every target as the file prints it: what a writer compares and writes."""
    if not program.held.any():
        return program, replacement
    old = turned_round(program.position, program.rotation, program.held)
    new = turned_round(
        np.asarray(replacement.position, dtype=np.float64),
        np.asarray(replacement.rotation, dtype=np.float64),
        program.held,
    )
    return (
        replace(program, position=old[0], rotation=old[1], held=np.empty(0, np.bool_)),
        replace(replacement, position=new[0], rotation=new[1]),
    )
