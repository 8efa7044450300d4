"""Where the arm works: regions as users write them, and the postures of a program's targets."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell, frame_table
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.planning.information import Postures
from robotrue.program.formats import read_job
from robotrue.program.program import Program, Reason
from robotrue.robot.inverse import inverse_batch

CYLINDER: Final = ("angle_deg", "height_mm", "radius_mm")
CUBE: Final = ("x_mm", "y_mm", "z_mm")
EXAMPLE: Final = "angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200"


def parse_region(option: str, text: str) -> Region:
    """Returns the region of e.g. ``angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200``.

    Raises:
        ConfigurationError: Other names, or limits that are no numbers.
    """
    limits: dict[str, tuple[float, float]] = {}
    try:
        for part in text.split(","):
            name, _, values = part.strip().partition("=")
            low, high = (float(v) for v in values.split(".."))
            limits[name] = (low, high)
    except ValueError:
        limits = {}
    kind = tuple(sorted(limits))
    if kind not in (CYLINDER, CUBE) or any(not low < high for low, high in limits.values()):
        raise ConfigurationError(
            f"{option} {text!r}, expected three ranges LOW..HIGH of angle_deg, radius_mm, "
            "height_mm or of x_mm, y_mm, z_mm.",
            hint=f"{option} {EXAMPLE}",
        )
    sized = {
        name.rpartition("_")[0]: (low * _size(name), high * _size(name))
        for name, (low, high) in limits.items()
    }
    return CylinderRegion(**sized) if kind == CYLINDER else CubeRegion(**sized)


def _size(name: str) -> float:
    return DEG if name.endswith("deg") else MM


MOST_TARGETS: Final = 2000
"""Targets of a program that are used, evenly over the file."""


def program_postures(cell: Cell, path: Path) -> Postures:
    """Returns the postures a program works in: its own targets, with its frames and tools.

    Raises:
        ReachError: The arm reaches none of them.
    """
    programs = read_job(path, frame_table(cell))
    joints = np.concatenate([_joints_of(cell, program) for program in programs])
    if not len(joints):
        raise ReachError(
            "no target of this program gives a posture of the arm.",
            source=path,
            hint="check its work frame and tool.",
        )
    return Postures(joints=joints, load=cell.payload)


def _joints_of(cell: Cell, program: Program) -> Array:
    usable = np.flatnonzero((program.reason == Reason.NONE) & np.isfinite(program.position[:, 0]))
    some = usable[np.unique(np.linspace(0, max(len(usable) - 1, 0), MOST_TARGETS).astype(int))][
        : len(usable)
    ]
    reached = [np.empty((0, cell.robot.dof))]
    for tool in np.unique(program.tool[some]):
        with_tool = some[program.tool[some] == tool]
        targets = program.T_base_frame[program.frame[with_tool]] @ pose(
            program.rotation[with_tool], program.position[with_tool]
        )
        joints = inverse_batch(cell.robot.with_tool(program.T_flange_tool[tool]), targets)
        reached.append(joints[np.isfinite(joints).all(axis=1)])
    return np.concatenate(reached)
