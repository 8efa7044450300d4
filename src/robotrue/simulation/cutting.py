"""The mean force of a cutting pass, so that a simulated hole is cut and not only driven.

Linear mechanistic model, forces averaged over a spindle turn (``dynamics.milling_force``), edge
terms left out. The pressures below are **assumed**, of the size printed for wrought aluminium;
Deng et al. 2022 print cutting data (Table 10) but no force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.dynamics import cutter as cutters
from robotrue.dynamics import milling_force as milling
from robotrue.errors import ConfigurationError

ALUMINIUM: Final = cutters.CuttingCoefficients(tangential=800e6, radial=240e6, axial=80e6)
"""Pa, assumed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndMillPass:
    """One kind of pass with an end mill that turns clockwise, seen from the spindle.

    Attributes:
        spindle: rev/s.
        teeth: Number of teeth.
        feed_per_tooth: m.
        depth: m, along the tool.
        width: m, radial.
        diameter: m, of the tool.
    """

    spindle: float
    teeth: int
    feed_per_tooth: float
    depth: float
    width: float
    diameter: float

    def __post_init__(self) -> None:
        """Checks the width of cut."""
        if not 0.0 < self.width <= self.diameter:
            raise ConfigurationError(
                f"width of cut {self.width / MM:g} mm, expected more than 0 and at most the "
                f"tool diameter {self.diameter / MM:g} mm."
            )

    @property
    def feed(self) -> float:
        """Feed rate, m/s."""
        return self.spindle * self.teeth * self.feed_per_tooth


SLOT: Final = EndMillPass(
    spindle=3000 / 60,
    teeth=3,
    feed_per_tooth=0.1 * MM,
    depth=1 * MM,
    width=10 * MM,
    diameter=10 * MM,
)
"""Slotting of Deng et al. 2022, Table 10."""
SIDE: Final = EndMillPass(
    spindle=6000 / 60,
    teeth=3,
    feed_per_tooth=0.05 * MM,
    depth=1 * MM,
    width=1 * MM,
    diameter=10 * MM,
)
"""Side milling of Deng et al. 2022, Table 10."""


def mean_force(cut: EndMillPass) -> Array:
    """Returns the mean force on the tool (3,) N: along the feed, to its left, along the tool up.

    Material stands to the right of the feed (climb milling) where the cut is narrower than the
    tool.
    """
    tool = cutters.Cutter(kind="flat", diameter=cut.diameter, teeth=cut.teeth)
    climb = cutters.CutterEngagement(
        mode="down",
        depth=cut.depth,
        width=cut.width,
        feed_per_tooth=cut.feed_per_tooth,
        spindle=cut.spindle,
    )
    return milling.mean_force(tool, climb, ALUMINIUM)


def cutting_wrench(cut: EndMillPass, feed_direction: Array, tool_axis: Array) -> Array:
    """Returns the wrench on the tool (n, 6) N, N m at its tip, in the axes of the arguments.

    Args:
        cut: The pass.
        feed_direction: (n, 3) unit vectors.
        tool_axis: (n, 3) unit vectors from the tip into the spindle.
    """
    left = np.cross(tool_axis, feed_direction)
    force = mean_force(cut)
    wrench = np.zeros((len(feed_direction), 6))
    wrench[:, :3] = force[0] * feed_direction + force[1] * left + force[2] * tool_axis
    return wrench
