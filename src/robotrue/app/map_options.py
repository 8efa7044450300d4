"""Options of ``robotrue map`` that are written as texts: ranges, grids, angles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.app.number_options import parse_numbers
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

RANGES: Final = {"cylinder": ("angle", "radius", "height"), "cube": ("x", "y", "z")}
"""Names of the three ranges of each kind of region."""
_EXAMPLES: Final = {
    "angle": "-40,40",
    "radius": "800,1400",
    "height": "700,1200",
    "x": "800,1400",
    "y": "-400,400",
    "z": "700,1200",
}


def parse_map_region(kind: str, ranges: Mapping[str, str | None]) -> Region:
    """Returns the region of a map from ``LOW,HIGH`` of each range.

    Raises:
        ConfigurationError: A range that is missing, is no range, or belongs to another kind.
    """
    names = RANGES[kind]
    limits = {}
    for name, text in ranges.items():
        if name not in names and text is not None:
            raise ConfigurationError(
                f"--{_option(name)} does not belong to a {kind}.",
                hint=f"a {kind} has {', '.join('--' + _option(n) for n in names)}.",
            )
    for name in names:
        text = ranges[name]
        option = f"--{_option(name)}"
        if text is None:
            raise ConfigurationError(
                f"a {kind} needs {option} LOW,HIGH.", hint=f"{option} {_EXAMPLES[name]}"
            )
        low, high = parse_numbers(option, text, 2)
        size = DEG if name == "angle" else MM
        limits[name] = (low * size, high * size)
    return CylinderRegion(**limits) if kind == "cylinder" else CubeRegion(**limits)


def _option(name: str) -> str:
    return f"{name}-deg" if name == "angle" else f"{name}-mm"


def parse_grid(text: str) -> tuple[int, int, int]:
    """Returns the grid values along each coordinate.

    Raises:
        ConfigurationError: Not three whole numbers, or too many points.
    """
    values = parse_numbers("--grid", text, 3)
    if (values != values.round()).any() or (values < 1).any() or values.prod() > 200_000:
        raise ConfigurationError(
            f"--grid {text!r}, expected three whole numbers of 1 or more, 200,000 points in all.",
            hint="--grid 8,7,6",
        )
    first, second, third = (int(v) for v in values)
    return first, second, third
