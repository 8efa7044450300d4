"""Raw hammer tests as CSV: ``t_s``, the hammer, the sensors.

The hammer is ``fx_N``, ``fy_N`` or ``fz_N``, after the axis it hits along. The sensors are
``ax_m_per_s2`` (accelerometer), ``vx_m_per_s`` (vibrometer) or ``x_um``, ``x_m`` (displacement) and
their like for y and z, one kind per file; an accelerometer may be in ``ax_g``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from robotrue.core.units import STANDARD_GRAVITY, UM
from robotrue.dynamics.formats.column_table import even_rate, read_column_table
from robotrue.dynamics.hits import HammerRecord

_HAMMER: Final = re.compile(r"f([xyz])_N")
_SENSOR: Final = re.compile(r"(a|v|)([xyz])_(\w+)")
_UNITS: Final = {
    ("a", "m_per_s2"): ("accelerance", 1.0),
    ("a", "g"): ("accelerance", STANDARD_GRAVITY),
    ("v", "m_per_s"): ("mobility", 1.0),
    ("", "m"): ("receptance", 1.0),
    ("", "um"): ("receptance", UM),
}


def read_hammer_csv(path: str | Path) -> HammerRecord:
    """Returns the record of a file.

    Raises:
        FormatError: No hammer or more than one, no sensor, a column that is not known or without
            its unit, a cell that is no finite number; with its line.
        ImplausibleDataError: An uneven clock.
    """
    table = read_column_table(path)
    hammers = [name for name in table.names if _HAMMER.fullmatch(name)]
    if len(hammers) != 1:
        raise table.fault(
            f"{len(hammers)} hammer columns, expected one of fx_N, fy_N, fz_N.",
            "one file per axis of the hammer.",
        )
    sensors: dict[str, str] = {}
    forms: set[tuple[str, float]] = set()
    for name in table.names:
        if name in ("t_s", hammers[0]):
            continue
        named = _SENSOR.fullmatch(name)
        if named is None or (named[1], named[3]) not in _UNITS:
            raise table.fault(
                f"column {name!r} is not known or has no unit; sensors are called ax_m_per_s2, "
                "ax_g, vx_m_per_s, x_m or x_um.",
                "rename or remove it.",
            )
        forms.add(_UNITS[named[1], named[3]])
        sensors[named[2]] = name
    if "t_s" not in table.names or not sensors:
        raise table.fault("no column t_s, or no sensor.", "t_s,fx_N,ax_m_per_s2,ay_m_per_s2")
    if len(forms) > 1:
        raise table.fault(f"sensors of {len(forms)} kinds or units.", "one kind per file.")
    form, scale = forms.pop()
    _, rate = even_rate(table.column("t_s"), path, table.line)
    axes = tuple(sorted(sensors))
    return HammerRecord(
        rate=rate,
        force=table.column(hammers[0]),
        excitation_axis=hammers[0][1],
        motion=scale * table.stack([sensors[axis] for axis in axes]),
        response_axes=axes,
        form=form,
        source=str(path),
        provenance=table.provenance,
    )
