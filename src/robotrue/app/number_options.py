"""Options that hold several numbers as one text, with commas between: numbers, ranges, grids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.core.arrays import Array, parse_number_list
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel


def parse_numbers(
    option: str, text: str, wanted: int | None = None, *, form: str = "", hint: str = ""
) -> Array:
    """Returns the numbers of an option.

    Args:
        option: As the user spells it.
        text: Its value.
        wanted: How many; None for any number.
        form: Their meaning, as ``A,B,C``.
        hint: One thing to try; empty: the form, or as many zeros.

    Raises:
        ConfigurationError: Another count, or not finite.
    """
    values = parse_number_list(text)
    if values.size != (wanted or values.size or 1):
        numbers = "numbers" if wanted is None else f"{wanted} numbers"
        example = form or ",".join(["0"] * (wanted or 2))
        raise ConfigurationError(
            f"{option} {text!r}, expected {numbers}"
            + (f": {form}." if form else " with commas between."),
            hint=hint or f"{option} {example}",
        )
    return values


def parse_posture(text: str | None, robot: RobotModel) -> Array | None:
    """Returns the joints (dof,) rad of ``--posture-deg``, which states axes as displayed.

    Raises:
        ConfigurationError: Another count than the robot has, or not finite.
    """
    if text is None:
        return None
    form = ",".join(f"A{k}" for k in range(1, robot.dof + 1))
    axes = parse_numbers("--posture-deg", text, robot.dof, form=form) * DEG
    return robot.controller.to_model(axes)


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
                f"--{_range_option(name)} does not belong to a {kind}.",
                hint=f"a {kind} has {', '.join('--' + _range_option(n) for n in names)}.",
            )
    for name in names:
        text = ranges[name]
        option = f"--{_range_option(name)}"
        if text is None:
            raise ConfigurationError(
                f"a {kind} needs {option} LOW,HIGH.", hint=f"{option} {_EXAMPLES[name]}"
            )
        low, high = parse_numbers(option, text, 2)
        size = DEG if name == "angle" else MM
        limits[name] = (low * size, high * size)
    return CylinderRegion(**limits) if kind == "cylinder" else CubeRegion(**limits)


def _range_option(name: str) -> str:
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
