"""Estimates as columns in shop-floor units: the names that files, messages and pages share."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, UM
from robotrue.errors import ShapeError
from robotrue.online.estimates import Doubt, EstimateBlock

_AXES: Final = ("x", "y", "z")
ERROR: Final = tuple(f"e{a}_um" for a in _AXES)
SD: Final = tuple(f"sd_{a}_um" for a in _AXES)
STATIC: Final = tuple(f"static_{a}_um" for a in _AXES)
WRENCH: Final = (*(f"f{a}_N" for a in _AXES), *(f"m{a}_Nm" for a in _AXES))
NO_DOUBT: Final = "none"
_BITS: Final = tuple(d for d in Doubt if d and d.value & (d.value - 1) == 0)


def number_columns(joints: int) -> tuple[str, ...]:
    """Returns the names of the columns of :func:`numbers`, units in the names."""
    return (*ERROR, *SD, *STATIC, *WRENCH, *(f"j{k}_deg" for k in range(1, joints + 1)))


def numbers(block: EstimateBlock, joints: int) -> Array:
    """Returns (n, 15 + joints) um, N, N m and deg; NaN where nothing is known.

    Every number of an invalid row that could be taken for an estimate is NaN, the static part and
    the band too; a block without joints has NaN there.

    Raises:
        ShapeError: The block is of an arm with another number of joints.
    """
    dof = block.joints.shape[1]
    if dof not in (0, joints):
        raise ShapeError(f"estimates of an arm of {dof} joints, expected {joints}.")
    out = np.full((len(block), 15 + joints), np.nan)
    out[:, 0:3] = block.error / UM
    out[:, 3:6] = block.sd / UM
    out[:, 6:9] = block.static / UM
    out[:, 9:15] = block.wrench
    out[:, 15 : 15 + dof] = block.joints / DEG
    out[~block.valid, :9] = np.nan
    return out


def doubt_words(doubt: int) -> str:
    """Returns the names of the bits of a doubt joined by ``+``, ``none`` for no doubt."""
    names = [str(d.name).lower() for d in _BITS if doubt & d]
    return "+".join(names) or NO_DOUBT


def doubt_names() -> dict[int, str]:
    """Returns the name of each bit of a doubt, lower case."""
    return {int(d): str(d.name).lower() for d in _BITS}
