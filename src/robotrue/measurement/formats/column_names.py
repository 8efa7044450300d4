"""What the names of columns say of them, where nobody states it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_JOINT: Final = re.compile(
    r"(?:j|a|q|axis|joint|theta)[ _]*([1-9])(?:[ _]*\[?(deg|rad|°)\]?)?", re.IGNORECASE
)
_AXIS: Final = re.compile(r"(?:.*[ _])?([xyz])(?:[ _]*\[?(mm|m|um|µm)\]?)?", re.IGNORECASE)


def guess_columns(header: Sequence[str]) -> tuple[dict[int, str], dict[str, str]]:
    """Returns the column of each joint by its number from 1, and that of x, y, z by its letter."""
    joints: dict[int, str] = {}
    axes: dict[str, str] = {}
    for name in header:
        if joint := _JOINT.fullmatch(name.strip()):
            joints.setdefault(int(joint[1]), name)
        elif axis := _AXIS.fullmatch(name.strip()):
            axes.setdefault(axis[1].lower(), name)
    return joints, axes


def guess_units(header: Sequence[str]) -> dict[str, str]:
    """Returns ``joints_unit``, ``position_unit`` and ``axes`` of a mapping, as far as names go."""
    joints, axes = guess_columns(header)
    units: dict[str, str] = {}
    for name in joints.values():
        match = _JOINT.fullmatch(name.strip())
        if match and match[2]:
            units["joints_unit"] = "rad" if match[2].lower() == "rad" else "deg"
        if name.strip()[:1] in "Aa":  # A1 to A6: as a pendant shows them
            units["axes"] = "controller"
    for name in axes.values():
        match = _AXIS.fullmatch(name.strip())
        if match and match[2]:
            units["position_unit"] = match[2].lower().replace("µ", "u")
    return units
