"""Cutter, cut and coefficients as users write them; tables of slots and of cuts along a path."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.coefficients import NAMES, CuttingTest
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.formats.column_table import read_column_table
from robotrue.errors import ConfigurationError

_WORDS: Final = ("kind", "mode")
_TOOL: Final = {
    "diameter_mm": MM, "teeth": 1, "helix_deg": DEG, "runout_um": UM, "runout_angle_deg": DEG,
}  # fmt: skip
_CUT: Final = {
    "depth_mm": MM, "width_mm": MM, "feed_per_tooth_mm": MM, "spindle_rpm": 1.0 / 60.0,
}  # fmt: skip
_SHEAR: Final = ("tangential_N_per_mm2", "radial_N_per_mm2", "axial_N_per_mm2")
_EDGE: Final = ("tangential_edge_N_per_mm", "radial_edge_N_per_mm", "axial_edge_N_per_mm")
_SCALE: Final = _TOOL | _CUT | dict.fromkeys(_SHEAR, 1e6) | dict.fromkeys(_EDGE, 1e3)
_SLOTS: Final = ("feed_per_tooth_mm", "fx_mean_N", "fy_mean_N", "fz_mean_N")
_ALONG: Final = ("path_mm", "depth_mm", "width_mm")
_OPTIONAL: Final = ("helix_deg", "runout_um", "runout_angle_deg", *_EDGE)


def cutting_data(
    stated: Mapping[str, object], *, where: str, slots: bool = False
) -> tuple[EndMill, CutterEngagement, CuttingCoefficients]:
    """Returns cutter, cut and coefficients of a table of keys.

    Args:
        stated: ``kind``, ``mode`` and numbers; helix, runout and edge coefficients may be absent.
        where: Name of the table, for messages.
        slots: Tests that determine the coefficients: feed and coefficients may be absent and are
            one.

    Raises:
        ConfigurationError: A missing or unknown key, or an impossible cut.
    """
    free = (*_OPTIONAL, "feed_per_tooth_mm", *_SHEAR) if slots else _OPTIONAL
    unknown = sorted(set(stated) - set(_SCALE) - set(_WORDS))
    missing = [key for key in (*_WORDS, *_SCALE) if key not in stated and key not in free]
    if unknown or missing:
        raise ConfigurationError(
            f"{where}: unknown key {unknown[0]}." if unknown else f"{where}: no {missing[0]}.",
            hint=f"the keys are {', '.join([*_WORDS, *_SCALE])}.",
        )
    absent = {"feed_per_tooth_mm": 1, _SHEAR[0]: 1} if slots else {}
    si: dict[str, float] = {}
    for key, factor in _SCALE.items():
        value = stated.get(key, absent.get(key, 0))
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise ConfigurationError(f"{where}: {key} is {value!r}, expected a number.")
        si[key] = value * factor
    teeth = stated["teeth"]
    if not isinstance(teeth, int):
        raise ConfigurationError(
            f"{where}: teeth is {teeth!r}, expected a whole number.", hint="teeth = 3"
        )
    cutter = EndMill(
        kind=str(stated["kind"]),
        diameter=si["diameter_mm"],
        teeth=teeth,
        helix=si["helix_deg"],
        runout=si["runout_um"],
        runout_angle=si["runout_angle_deg"],
    )
    cut = CutterEngagement(
        mode=str(stated["mode"]),
        depth=si["depth_mm"],
        width=si["width_mm"],
        feed_per_tooth=si["feed_per_tooth_mm"],
        spindle=si["spindle_rpm"],
    )
    return cutter, cut, coefficients_of(si[key] for key in (*_SHEAR, *_EDGE))


def coefficients_of(values: Iterable[float]) -> CuttingCoefficients:
    """Returns coefficients of six numbers, Pa and N/m, in the order of the keys."""
    return CuttingCoefficients(**dict(zip(NAMES, values, strict=True)))


def coefficient_keys(coefficients: CuttingCoefficients) -> dict[str, float]:
    """Returns the six keys with their values, N/mm2 and N/mm."""
    keys = zip((*_SHEAR, *_EDGE), NAMES, strict=True)
    return {key: getattr(coefficients, name) / _SCALE[key] for key, name in keys}


def cutting_text(stated: Mapping[str, str | float]) -> str:
    """Returns a table of keys as TOML: texts, whole numbers and numbers."""
    return "".join(f"{key} = {_toml(value)}\n" for key, value in stated.items())


def _toml(value: str | float) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value) if isinstance(value, int) else repr(float(value))


def read_slots(path: Path, cut: CutterEngagement) -> list[CuttingTest]:
    """Returns slotting tests with their mean forces.

    Args:
        path: One row per test.
        cut: Data missing from the table: mode and spindle, depth and width where it has none.

    Raises:
        FormatError: A column that is missing or not known.
    """
    table = read_column_table(path)
    table.require(_SLOTS, ("depth_mm", "width_mm"))
    values = {name: table.column(name) for name in table.names}
    sizes = {"depth_mm": "depth", "width_mm": "width", "feed_per_tooth_mm": "feed_per_tooth"}
    stated = {field: values[name] * MM for name, field in sizes.items() if name in values}
    return [
        CuttingTest(
            cut=replace(cut, **{field: rows[k] for field, rows in stated.items()}),
            force=np.array([values[name][k] for name in _SLOTS[1:]]),
        )
        for k in range(len(table.values))
    ]


def read_along(path: Path) -> tuple[Array, Array, Array]:
    """Returns length along a path, depth and width there, (n,) m each.

    Raises:
        FormatError: A column that is missing or not known.
    """
    table = read_column_table(path)
    table.require(_ALONG)
    along, depth, width = (table.column(name) * MM for name in _ALONG)
    return along, depth, width
