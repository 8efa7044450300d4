"""A plan of touches as a table to be filled in: the file that registering reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.core.csv_text import csv_text
from robotrue.core.units import DEG, MM
from robotrue.measurement.formats.part_points import PLANNED
from robotrue.measurement.probing_set import ProbingSet


def touch_sheet(touches: ProbingSet, parts: Sequence[str]) -> bytes:
    """Returns touches as CSV, one row each in their order: columns of a file of touched points.

    The joints are those planned. At the machine each row gets the joints at its touch instead, and
    the first line goes; until then the file is refused, since planned joints fit exactly.

    Args:
        touches: With joints.
        parts: Name of each part by its number; the column is left out for one part alone.
    """
    dof = touches.joints.shape[1]
    header = ["name", "px_mm", "py_mm", "pz_mm", *(f"j{i + 1}_deg" for i in range(dof))]
    normals = not touches.full.all()
    if normals:
        header += ["nx", "ny", "nz"]
    if len(parts) > 1:
        header.append("part")
    head = f"{PLANNED}: put the joints at each touch in their place, then delete this line\n"
    rows = [header]
    for k, name in enumerate(touches.names):
        row = [name, *_numbers(touches.point[k] / MM), *_numbers(touches.joints[k] / DEG)]
        if normals:
            row += _numbers(touches.normal[k])
        if len(parts) > 1:
            row.append(parts[int(touches.part[k])])
        rows.append(row)
    return (head + csv_text(rows)).encode()


def _numbers(values: Sequence[float]) -> list[str]:
    return ["" if np.isnan(v) else f"{v:.6f}".rstrip("0").rstrip(".") for v in values]
