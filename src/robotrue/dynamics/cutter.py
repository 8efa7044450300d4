"""End mills, cutting coefficients, and the engagement of the cutter.

Axes of every force here: x along the feed, y to its left, z along the tool from tip to spindle. The
tool turns clockwise seen from the spindle; the angle of a tooth counts clockwise from +y, so that
the chip is thickest at 90 deg, ahead of the tool.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

KINDS: Final = ("flat", "ball")
MODES: Final = ("up", "down", "slot")


@dataclass(frozen=True, slots=True, kw_only=True)
class EndMill:
    """An end mill.

    Attributes:
        kind: ``"flat"`` or ``"ball"``.
        diameter: m.
        teeth: Number of teeth, evenly spaced.
        helix: rad, right-handed above zero.
        runout: m, distance of the tool's axis from the spindle's.
        runout_angle: rad, direction of that offset, clockwise from tooth 0 at the tip.
    """

    kind: str
    diameter: float
    teeth: int
    helix: float = 0.0
    runout: float = 0.0
    runout_angle: float = 0.0

    def __post_init__(self) -> None:
        """Checks the tool."""
        if self.kind not in KINDS:
            raise ConfigurationError(f"cutter of kind {self.kind!r}, expected one of {KINDS}.")
        if not self.diameter > 0.0 or self.teeth < 1:
            raise ConfigurationError(
                f"cutter of {self.diameter / MM:g} mm with {self.teeth} teeth; "
                "both have to be above zero."
            )
        if not abs(self.helix) < np.deg2rad(80.0):
            raise ConfigurationError(
                f"helix of {np.rad2deg(self.helix):g} deg, expected less than 80 either way."
            )
        if not 0.0 <= self.runout < self.radius:
            raise ConfigurationError(
                f"runout of {self.runout / MM:g} mm on a radius of {self.radius / MM:g} mm."
            )

    @property
    def radius(self) -> float:
        """Metres."""
        return self.diameter / 2.0

    def radius_at(self, height: Array) -> Array:
        """Returns the radius (k,) m at heights (k,) m above the tip."""
        if self.kind == "flat":
            return np.full(np.shape(height), self.radius, dtype=np.float64)
        below = np.clip(self.radius - np.asarray(height), 0.0, self.radius)
        return np.asarray(np.sqrt(self.radius**2 - below**2))

    def lag(self, height: Array) -> Array:
        """Returns the lag of the edge behind its tip (k,) rad at heights (k,) m."""
        return np.asarray(np.asarray(height) * np.tan(self.helix) / self.radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingCoefficients:
    """Force per chip area (shear, Pa) and per length of edge (edge, N/m).

    Tangential forces oppose the cutting speed, radial ones push the tool off the material along
    the surface's normal. Positive axial ones push towards the shank, along the edge's meridian:
    sources that count it towards the tip print the other sign.

    Attributes:
        tangential: Pa.
        radial: Pa.
        axial: Pa.
        tangential_edge: N/m.
        radial_edge: N/m.
        axial_edge: N/m.
    """

    tangential: float
    radial: float
    axial: float
    tangential_edge: float = 0.0
    radial_edge: float = 0.0
    axial_edge: float = 0.0

    def __post_init__(self) -> None:
        """Checks that the material resists."""
        if not self.tangential > 0.0:
            raise ConfigurationError(
                f"tangential coefficient {self.tangential * 1e-6:g} N/mm2, expected above zero."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class CutterEngagement:
    """Steady engagement of the cutter.

    Attributes:
        mode: ``"up"`` (material to the left of the feed), ``"down"`` (to its right) or ``"slot"``.
        depth: m, along the tool from the tip.
        width: m, radial; the diameter for a slot.
        feed_per_tooth: m.
        spindle: rev/s.
    """

    mode: str
    depth: float
    width: float
    feed_per_tooth: float
    spindle: float

    def __post_init__(self) -> None:
        """Checks signs and the mode."""
        if self.mode not in MODES:
            raise ConfigurationError(f"milling mode {self.mode!r}, expected one of {MODES}.")
        for name in ("depth", "width", "feed_per_tooth", "spindle"):
            if not getattr(self, name) > 0.0:
                raise ConfigurationError(
                    f"{name.replace('_', ' ')} of the cut is {getattr(self, name):g}, expected "
                    "above zero."
                )

    def feed(self, teeth: int) -> float:
        """Returns the feed rate, m/s."""
        return self.spindle * teeth * self.feed_per_tooth


def engagement(cutter: EndMill, cut: CutterEngagement, height: Array) -> tuple[Array, Array]:
    """Returns angles of entry and exit (k,) rad at heights (k,) m; equal where nothing is cut.

    The wall of the material is a plane along the feed, ``width`` inside the tool's outline.

    Raises:
        ConfigurationError: The width of cut is more than the diameter.
    """
    if cut.width > cutter.diameter * (1.0 + 1e-12):
        raise ConfigurationError(
            f"width of cut {cut.width / MM:g} mm, at most the diameter {cutter.diameter / MM:g} mm."
        )
    local = cutter.radius_at(height)
    if cut.mode == "slot":
        return np.zeros_like(local), np.where(local > 0.0, np.pi, 0.0)
    wall = cutter.radius - cut.width
    ratio = np.divide(wall, local, out=np.full_like(local, np.sign(wall)), where=local > 0.0)
    swept = np.arccos(np.clip(ratio, -1.0, 1.0))
    if cut.mode == "up":
        return np.zeros_like(swept), swept
    return np.pi - swept, np.full_like(swept, np.pi)
