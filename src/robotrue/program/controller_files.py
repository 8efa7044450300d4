"""Frames and tools in a file that a controller saves, and the format of its numbers.

They are printed to 1e-4 mm and 1e-6 deg, and never as a minus zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError

NUMBER: Final = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"
"""A number in such a file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerFile:
    """Content of one file.

    Attributes:
        name: File name.
        bases: Work frames (4, 4) in the robot base, by number.
        tools: Tools (4, 4) on the flange, by number.
        notes: Contents that cannot be used, one sentence each.
        T_base_world: The controller's world frame (4, 4) in the robot base, where the file states
            it; frames of other files of this controller are in it.
        declarations: The file holds variables that programs name.
        pulses_per_degree: (6,) signed, where the file states them.
    """

    name: str
    bases: dict[str, Array] = field(default_factory=dict)
    tools: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    T_base_world: Array | None = None
    declarations: bool = False
    pulses_per_degree: Array | None = None


def all_finite(numbers: Sequence[str]) -> bool:
    """Returns whether numbers, as written, are finite."""
    return bool(np.isfinite([float(number) for number in numbers]).all())


def frame_of(xyz_mm: Sequence[float], abc_deg: Sequence[float]) -> Array:
    """Returns the frame (4, 4) m of X Y Z in mm and the turns A about z, B about y, C about x."""
    return pose_from_xyz_abc(np.array(xyz_mm) * MM, np.array(abc_deg) * DEG)


def unreadable_frame(name: str, text: str, place: int, what: str) -> FormatError:
    """Returns the refusal of a frame that begins at a place of a text."""
    return FormatError(
        f"{what} has not six finite numbers.",
        source=name,
        line=text.count("\n", 0, place) + 1,
        hint="save the file from the controller again.",
    )


def print_mm(xyz_mm: Array) -> tuple[str, str, str]:
    """Returns a position (3,) mm with four decimals."""
    x, y, z = (f"{np.round(value, 4) + 0.0:.4f}" for value in xyz_mm)
    return x, y, z


def print_abc(rotation: Array) -> tuple[str, str, str]:
    """Returns A, B, C in deg of R = Rz(A) Ry(B) Rx(C) (3, 3) with six decimals."""
    a, b, c = (f"{np.round(value, 6) + 0.0:.6f}" for value in abc_from_matrix(rotation) / DEG)
    return a, b, c


def print_values(values: Array, decimals: int, separator: str) -> str:
    """Returns values (k,) with fixed decimals."""
    return separator.join(f"{value:.{decimals}f}" for value in values + 0.0)
