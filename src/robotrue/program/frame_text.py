"""Numbers of frames as controllers print them: to 1e-4 mm and 1e-6 deg, and never a minus zero."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG


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
