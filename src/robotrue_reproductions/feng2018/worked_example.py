"""The worked example of Feng, Liang, Xi 2018, and what its equations do as they are printed.

Arithmetic: no cell, no noise. The paper prints no lengths; the triangle is 400 by 300 mm.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.cell.registration.rounds import Adjustment
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018.equation_readings import (
    CORRECTED,
    EquationReadings,
    correction_of,
    turn,
)
from robotrue_reproductions.feng2018.three_point_recursion import adjust_recursively
from robotrue_reproductions.reproduction import Figure, figure

TRIANGLE: Final = np.array([[0.0, 0.0, 0.0], [400.0, 0.0, 0.0], [0.0, 300.0, 0.0]]) * MM
"""K, L, M, m."""
FIRST: Final = np.array([3.0, 2.3, 3.5]) * DEG
SECOND: Final = np.array([0.75, 0.36, 0.48]) * DEG
SHIFT: Final = np.array([-5.0, 2.5, -3.0]) * MM
READINGS: Final = (
    ("as it must be read", CORRECTED),
    ("eq. 11 as printed, o = n x a", EquationReadings(second_axis="n x a")),
    ("eq. 12 as printed, transposed", EquationReadings(attitude="base in feature")),
    ("eq. 15 as printed, angles exchanged", EquationReadings(angle_values="equation 15")),
    ("eq. 14 along the turned axes, as the text says", EquationReadings(shift_axes="feature")),
)


def worked_example() -> list[Figure]:
    """Returns the figures of the worked example, noise-free."""
    touched = apply(pose_from_xyz_abc(SHIFT, FIRST), TRIANGLE)
    once = _replay(CORRECTED, touched, passes=1)
    found = once.passes[0]
    both = abc_from_matrix(turn(FIRST) @ turn(SECOND)) / DEG
    out = []
    for k, axis in enumerate("zyx"):
        paper = float(FIRST[k] / DEG)
        out.append(figure("worked", "first turn", axis, "deg", paper, found.angles[k] / DEG))
    for k, axis in enumerate("xyz"):
        out.append(figure("worked", "shift", axis, "mm", float(SHIFT[k] / MM), found.shift[k] / MM))
    left = once.passes[1].worst / MM
    out.append(figure("worked", "left after the first pass", "worst of K, L, M", "mm", None, left))
    for k, axis in enumerate("zyx"):
        out.append(figure("worked", "both printed turns as one", axis, "deg", None, both[k]))
    return out


def wrong_readings() -> list[Figure]:
    """Returns the error of the worked example after every pass, for each reading."""
    part = apply(pose(turn(FIRST) @ turn(SECOND), SHIFT), TRIANGLE)
    out = []
    for name, readings in READINGS:
        worst = [p.worst / MM for p in _replay(readings, part, passes=3).passes[:4]]
        worst += [0.0] * (4 - len(worst))  # ended where nothing was left
        for k, value in enumerate(worst):
            out.append(
                figure("readings", name, f"after pass {k}" if k else "start", "mm", None, value)
            )
    return out


def _replay(readings: EquationReadings, part: Array, *, passes: int) -> Adjustment:
    return adjust_recursively(
        TRIANGLE,
        np.eye(4),
        lambda run: part,
        sigma=0.0,
        correct=correction_of(readings),
        angle_tolerance=0.0,
        position_tolerance=0.0,
        most=passes,
    )
