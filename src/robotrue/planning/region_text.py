"""Regions as users write them: three ranges in deg and mm."""

from __future__ import annotations

from typing import Final

from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

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
