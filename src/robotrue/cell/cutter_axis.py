"""Which way the cutter points in the tool frame of a cell."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError

CUTTERS: Final = {
    f"{sign}{axis}": value * np.eye(3)[k]
    for sign, value in (("", 1.0), ("+", 1.0), ("-", -1.0))
    for k, axis in enumerate("xyz")
}
ASIDE: Final = 60.0 * DEG
"""A cutter axis further than this off the way from flange to tip must be stated."""


def cutter_axis(cell: Cell, text: str | None) -> Array:
    """Returns the way from spindle to tip (3,) in the tool frame.

    Args:
        cell: Its tool.
        text: As stated on the command line; None takes +z where that is plausible.

    Raises:
        ConfigurationError: No axis, or none stated where it is not plain which it is.
    """
    if text is not None:
        if text.lower() not in CUTTERS:
            raise ConfigurationError(
                f"--cutter {text!r}, expected x, y, z, -x, -y or -z.", hint="--cutter z"
            )
        return np.asarray(CUTTERS[text.lower()])
    tip = cell.robot.T_flange_tool[:3, 3]
    length = float(np.linalg.norm(tip))
    axis = CUTTERS["z"]
    along = float(cell.robot.T_flange_tool[:3, :3] @ axis @ tip) / max(length, 1e-9)
    if length > 1e-3 and along < np.cos(ASIDE):
        raise ConfigurationError(
            "the z axis of [tool] points "
            f"{np.degrees(np.arccos(np.clip(along, -1.0, 1.0))):.0f} deg away from the way from "
            f"the flange to the tip (at most {ASIDE / DEG:.0f} deg are taken without asking): "
            "which axis of the tool frame is the cutter's is not plain.",
            source=cell.source or None,
            hint="--cutter x (KUKA's own convention), or --cutter z to say that it is meant.",
        )
    return np.asarray(axis)
