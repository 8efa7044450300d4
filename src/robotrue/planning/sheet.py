"""A plan as a table to be filled in: the canonical columns, positions left blank."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.units import DEG, MM
from robotrue.measurement.formats.canonical import canonical_mapping
from robotrue.planning.pose_plan import PosePlan


def plan_sheet(plan: PosePlan) -> bytes:
    """Returns the plan as CSV, one row per pose in the order of measuring.

    The columns are those a calibration reads. ``x_mm, y_mm, z_mm`` are blank: the measured points
    go there, and a row that was left blank is refused, not taken for a measurement.
    """
    names = canonical_mapping(plan.joints.shape[1])
    columns = _block(names.joints, plan.joints / DEG)
    columns |= {name: [""] * len(plan) for name in names.position}
    columns |= {
        name: [str(int(sign)) for sign in plan.approach[:, i]]
        for i, name in enumerate(names.approach)
    }
    if len(plan.loads) > 1:
        mass = np.array([load.mass[0] for load in plan.loads])[plan.load]
        centre = np.array([load.com[0] for load in plan.loads])[plan.load]
        wrench = np.array([load.wrench[0] for load in plan.loads])[plan.load]
        columns |= _block(names.payload_mass, mass[:, None])
        columns |= _block(names.payload_com, centre / MM)
        if wrench.any():
            columns |= _block(names.force, wrench[:, :3]) | _block(names.moment, wrench[:, 3:])
    head = "# poses to be measured; fill in x_mm, y_mm, z_mm and give the file to calibrate\n"
    return (head + csv_text([columns, *zip(*columns.values(), strict=True)])).encode()


def _block(names: tuple[str, ...], values: Array) -> dict[str, list[str]]:
    return {name: [_number(v) for v in values[:, i]] for i, name in enumerate(names)}


def _number(value: float) -> str:
    return f"{value:.6f}".rstrip("0").rstrip(".") if value else "0"
