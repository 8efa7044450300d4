"""What a cell says of its controller as lines of TOML."""

from __future__ import annotations

import json
from typing import Final

import numpy as np

from robotrue.cell.toml_text import number, numbers
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable

ROBOT: Final = "robot"
"""What a rail carries."""


def controller_text(told: FrameTable) -> list[str]:
    """Returns the table as lines of TOML, frames by number or name with all digits."""
    lines = ["", "[controller]"]
    if told.pulses_per_degree is not None:
        lines.append(f"pulses_per_degree = {numbers(told.pulses_per_degree)}")
    if told.external_axes_at_rest:
        lines.append("external_axes_at_rest = true")
    if told.fixed_tool:
        lines.append(f'fixed_tool = "{told.fixed_tool}"')
    lines += _orientation_text(told.orientation)
    if len(told.start):
        lines.append(f"start_deg = {numbers(told.start / DEG)}")
    if told.harmless_routines:
        lines.append(f"harmless_routines = {json.dumps(told.harmless_routines)}")
    for side, table in (("base", told.bases), ("tool", told.tools)):
        for key, matrix in table.items():
            plain = key.isascii() and key.isdigit()
            lines += ["", f"[[controller.{side}]]"]
            lines.append(f"number = {int(key)}" if plain else f"name = {json.dumps(key)}")
            lines.append(f"xyz_mm = {numbers(matrix[:3, 3] / MM)}")
            lines.append(f"abc_deg = {numbers(abc_from_matrix(matrix[:3, :3]) / DEG)}")
    for axis in told.external:
        lines += ["", "[[controller.external]]", *_axis_text(axis)]
    return lines


def _orientation_text(rule: OrientationRule) -> list[str]:
    lines = [f'angles = "{rule.angles}"'] if rule.angles else []
    axis = int(np.argmax(np.abs(rule.cutter)))
    name = ("-" if rule.cutter[axis] < 0.0 else "") + "xyz"[axis]
    if name != "z":
        lines.append(f'cutter = "{name}"')
    if rule.spin is not None:
        lines.append(f"spin_deg = {number(rule.spin / DEG)}")
    return lines


def _axis_text(axis: ExternalAxis) -> list[str]:
    kind = "along" if axis.point is None else "about"
    carries = [ROBOT] if axis.carries_robot else list(axis.frames)
    unit = "mm" if axis.point is None else "deg"
    lines = [f"axis = {axis.number}", f"{kind} = {numbers(axis.direction)}"]
    if axis.name:
        lines.append(f"name = {json.dumps(axis.name)}")
    if axis.point is not None:
        lines.append(f"through_mm = {numbers(axis.point / MM)}")
    lines.append(f"at_{unit} = {number(axis.at / axis.unit)}")
    lines.append(f"carries = {json.dumps(carries)}")
    if np.isfinite(axis.per_pulse):
        per = "mm" if axis.point is None else "degree"
        lines.append(f"pulses_per_{per} = {number(1.0 / axis.per_pulse)}")
    return lines
